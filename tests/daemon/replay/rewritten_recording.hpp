#pragma once
/// A recording as another program may write it again: everything that MCAP does not require can be
/// left out.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>

#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/protocol/mcap/records.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon::test {

struct Rewrite {
  bool chunk_indexes = true;
  bool message_indexes = true;
  bool channels_in_front = true;
  bool channels_in_chunks = false;
  bool channels_in_summary = true;
  bool metadata_indexes = true;
  bool attachment_indexes = true;
  bool statistics = true;
  bool summary = true;
  bool chunks = true;  ///< false: the messages lie outside of chunks
  bool unknown_records = false;
  std::string compression;  ///< only the name: the bytes stay as they are
};

class RecordingRewriter {
 public:
  RecordingRewriter(const FileBytes& whole, Rewrite how)
      : how_(std::move(how)), whole_(std::as_bytes(std::span{whole})) {}

  [[nodiscard]] FileBytes rewritten() {
    protocol::mcap::append_magic(out_);
    collect_channels();
    protocol::mcap::LinearScan scan{whole_};
    while (const auto item = scan.next()) item->chunk ? chunk(*item->chunk) : record(item->record);
    append(out_, protocol::mcap::DataEnd{});
    const std::uint64_t summary_start = out_.size();
    if (how_.summary) summary();
    const bool empty = out_.size() == summary_start;
    append(out_, protocol::mcap::Footer{empty ? 0 : summary_start, 0, 0});
    protocol::mcap::append_magic(out_);
    const auto* begin = reinterpret_cast<const char*>(out_.data());
    return {begin, begin + out_.size()};
  }

 private:
  using Bytes = protocol::mcap::Bytes;
  using Buffer = protocol::mcap::Buffer;
  using Opcode = protocol::mcap::Opcode;

  static void copy(const protocol::mcap::Record& record, Bytes from, Buffer& to) {
    const auto bytes = from.subspan(record.offset, record.end() - record.offset);
    to.insert(to.end(), bytes.begin(), bytes.end());
  }
  static bool describes_channels(Opcode opcode) {
    return opcode == Opcode::Schema || opcode == Opcode::Channel;
  }
  void collect_channels() {
    protocol::mcap::LinearScan scan{whole_};
    while (const auto item = scan.next())
      if (describes_channels(item->record.opcode)) copy(item->record, whole_, channels_);
  }
  void unknown_record() {
    constexpr std::byte kOfALaterVersion{0x7e}, kPrivate{0x90};
    for (const std::byte opcode : {kOfALaterVersion, kPrivate}) {
      out_.push_back(opcode);
      for (int i = 0; i < 8; ++i) out_.push_back(i == 0 ? std::byte{3} : std::byte{0});
      out_.insert(out_.end(), 3, std::byte{0xaa});
    }
  }

  void record(const protocol::mcap::Record& record) {
    if (how_.unknown_records) unknown_record();
    if (describes_channels(record.opcode) && !how_.channels_in_front) return;
    if (record.opcode == Opcode::MessageIndex && (!how_.message_indexes || !how_.chunks)) return;
    const std::uint64_t offset = out_.size();
    copy(record, whole_, out_);
    const std::uint64_t length = out_.size() - offset;
    if (record.opcode == Opcode::Metadata) {
      const auto metadata = protocol::mcap::decode<protocol::mcap::Metadata>(record.content);
      if (how_.metadata_indexes)
        append(summary_, protocol::mcap::MetadataIndex{offset, length, metadata->name});
      ++statistics_.metadata_count;
    }
    if (record.opcode == Opcode::Attachment) {
      const auto a = protocol::mcap::decode<protocol::mcap::Attachment>(record.content);
      if (how_.attachment_indexes)
        append(summary_,
               protocol::mcap::AttachmentIndex{offset, length, a->log_time_ns, a->create_time_ns,
                                               a->data.size(), a->name, a->media_type});
      ++statistics_.attachment_count;
    }
  }

  void chunk(const protocol::mcap::ScannedChunk& scanned) {
    for (protocol::mcap::MessageReader all{scanned.chunk.records}; all.next();)
      ++statistics_.message_count;
    if (!how_.chunks) {
      out_.insert(out_.end(), scanned.chunk.records.begin(), scanned.chunk.records.end());
      return;
    }
    Buffer records = how_.channels_in_chunks ? channels_ : Buffer{};
    records.insert(records.end(), scanned.chunk.records.begin(), scanned.chunk.records.end());
    protocol::mcap::Chunk chunk{scanned.chunk.head, records};
    chunk.head.uncompressed_crc = 0;
    chunk.head.uncompressed_size = records.size();
    chunk.head.compression = how_.compression;
    const std::uint64_t offset = out_.size();
    append(out_, chunk);
    ++statistics_.chunk_count;
    if (how_.chunk_indexes)
      append(summary_, protocol::mcap::ChunkIndex{.first_time_ns = chunk.head.first_time_ns,
                                                  .last_time_ns = chunk.head.last_time_ns,
                                                  .chunk_start = offset,
                                                  .chunk_length = out_.size() - offset,
                                                  .index_offsets = {},
                                                  .index_length = 0,
                                                  .compression = how_.compression,
                                                  .compressed_size = records.size(),
                                                  .uncompressed_size = records.size()});
  }

  void summary() {
    if (how_.channels_in_summary) out_.insert(out_.end(), channels_.begin(), channels_.end());
    out_.insert(out_.end(), summary_.begin(), summary_.end());
    if (how_.statistics) append(out_, statistics_);
  }

  Rewrite how_;
  Bytes whole_;
  Buffer out_, channels_, summary_;
  protocol::mcap::Statistics statistics_;
};

inline void rewrite(const std::filesystem::path& from, const std::filesystem::path& to,
                    const Rewrite& how) {
  const FileBytes whole = bytes_of_file(from);
  const FileBytes bytes = RecordingRewriter(whole, how).rewritten();
  write_file(to, bytes, bytes.size());
}

}  // namespace abbe::daemon::test
