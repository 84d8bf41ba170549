#include "abbe/protocol/mcap/reader.hpp"

#include <algorithm>

#include "abbe/protocol/mcap/crc32.hpp"
#include "mcap/fields.hpp"

namespace abbe::protocol::mcap {
namespace {

bool magic_at(Bytes file, std::size_t offset) noexcept {
  return std::ranges::equal(file.subspan(offset, kMagic.size()), kMagic);
}

ScannedChunk::State judge(const Chunk& chunk) noexcept {
  if (!chunk.head.compression.empty()) return ScannedChunk::State::Compressed;
  if (chunk.head.uncompressed_size != chunk.head.records_size)
    return ScannedChunk::State::Malformed;
  const std::uint32_t crc = chunk.head.uncompressed_crc;
  return crc == 0 || crc == crc32(chunk.records) ? ScannedChunk::State::Whole
                                                 : ScannedChunk::State::BadCrc;
}

ScannedChunk scanned(const Record& record) noexcept {
  const auto chunk = decode<Chunk>(record.content);
  if (!chunk) return {ScannedChunk::State::Malformed, record.offset, {}};
  return {judge(*chunk), record.offset, *chunk};
}

}  // namespace

std::optional<Record> RecordReader::next() noexcept {
  if (state_ != State::Reading) return std::nullopt;
  if (position_ >= bytes_.size()) {
    state_ = State::End;
    return std::nullopt;
  }

  const Bytes rest = bytes_.subspan(position_);
  if (rest.front() == std::byte{0}) {
    state_ = State::Garbage;
    return std::nullopt;
  }

  FieldReader fields{rest};
  Record record;
  record.opcode = static_cast<Opcode>(fields.integer<std::uint8_t>());
  record.offset = position_;
  record.content = fields.long_bytes();

  if (!fields.ok()) {
    state_ = State::Truncated;
    return std::nullopt;
  }

  position_ = record.end();
  return record;
}

std::optional<Message> MessageReader::next() noexcept {
  while (const auto record = records_.next()) {
    if (record->opcode != Opcode::Message) continue;
    if (const auto message = decode<Message>(record->content)) return *message;
  }
  return std::nullopt;
}

bool starts_with_magic(Bytes file) noexcept {
  return file.size() >= kMagic.size() && magic_at(file, 0);
}

bool ends_with_magic(Bytes file) noexcept {
  return file.size() >= kMagic.size() && magic_at(file, file.size() - kMagic.size());
}

LinearScan::LinearScan(Bytes file) noexcept
    : file_(file),
      records_(file, std::min(file.size(), kMagic.size())),
      stopped_(!starts_with_magic(file)) {}

std::optional<LinearScan::Item> LinearScan::next() noexcept {
  if (stopped_) return std::nullopt;
  const auto record = records_.next();
  if (!record) {
    stopped_ = true;
    return records_.state() == RecordReader::State::Truncated ? cut_chunk() : std::nullopt;
  }

  if (record->opcode == Opcode::DataEnd) {
    complete_ = stopped_ = true;
    return std::nullopt;
  }

  Item item{*record, std::nullopt};
  if (record->opcode == Opcode::Chunk) item.chunk = scanned(*record);
  return item;
}

std::optional<LinearScan::Item> LinearScan::cut_chunk() noexcept {
  const std::size_t offset = records_.position();
  const Bytes rest = file_.subspan(offset);
  if (rest.size() < kRecordHeadSize ||
      rest.front() != std::byte{static_cast<std::uint8_t>(Opcode::Chunk)}) {
    return std::nullopt;
  }
  const Record record{Opcode::Chunk, offset, rest.subspan(kRecordHeadSize)};
  const auto chunk = decode_cut_chunk(record.content);
  if (!chunk || !chunk->head.compression.empty()) return std::nullopt;
  return Item{record, ScannedChunk{ScannedChunk::State::Cut, offset, *chunk}};
}

std::optional<RecordHead> read_head(Bytes bytes) noexcept {
  if (bytes.size() < kRecordHeadSize || bytes.front() == std::byte{0}) return std::nullopt;
  FieldReader fields{bytes};
  RecordHead head;
  head.opcode = static_cast<Opcode>(fields.integer<std::uint8_t>());
  head.length = fields.integer<std::uint64_t>();
  return head;
}

std::optional<Record> record_at(Bytes file, std::uint64_t offset, Opcode expected) noexcept {
  if (offset >= file.size()) return std::nullopt;
  RecordReader reader{file, static_cast<std::size_t>(offset)};
  const auto record = reader.next();
  return record && record->opcode == expected ? record : std::nullopt;
}

std::optional<ScannedChunk> chunk_at(Bytes file, std::uint64_t offset) noexcept {
  const auto record = record_at(file, offset, Opcode::Chunk);
  if (!record) return std::nullopt;
  return scanned(*record);
}

}  // namespace abbe::protocol::mcap
