#include "left_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "abbe/protocol/mcap/crc32.hpp"
#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon::recording {

namespace mcap = protocol::mcap;

namespace {

/// Larger than any piece that abbed writes at once: a chunk of 64 MiB and its indexes.
constexpr std::uint64_t kLargestPiece = std::uint64_t{128} << 20;
/// Length of the fields of an uncompressed chunk record before its messages.
constexpr std::uint64_t kChunkHeadBytes = 8 + 8 + 8 + 4 + 4 + 8;

std::uint64_t length_at(mcap::Bytes bytes, std::size_t at) {
  std::uint64_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof number);
  return number;
}

/// True if `tail` contains a whole chunk. No chunk can follow a record that was truncated by the
/// end of the file. If a whole chunk follows a record that seems truncated, the length of that
/// record is damaged.
bool contains_whole_chunk(mcap::Bytes tail) {
  constexpr std::byte kChunk{static_cast<std::uint8_t>(mcap::Opcode::Chunk)};
  constexpr std::size_t kRecordsSizeAt = mcap::kRecordHeadSize + kChunkHeadBytes - 8;
  constexpr std::size_t kLeast = mcap::kRecordHeadSize + kChunkHeadBytes;

  for (auto at = std::ranges::find(tail, kChunk); at != tail.end();
       at = std::find(at + 1, tail.end(), kChunk)) {
    const auto record = tail.subspan(static_cast<std::size_t>(at - tail.begin()));
    if (record.size() < kLeast) return false;
    const std::uint64_t length = length_at(record, 1);
    if (length < kChunkHeadBytes || length > record.size() - mcap::kRecordHeadSize ||
        length - kChunkHeadBytes != length_at(record, kRecordsSizeAt))
      continue;
    const auto chunk = mcap::decode<mcap::Chunk>(record.subspan(mcap::kRecordHeadSize, length));
    if (chunk && chunk->head.uncompressed_crc == mcap::crc32(chunk->records)) return true;
  }

  return false;
}

}  // namespace

std::uint64_t LeftFile::Head::end() const {
  return offset + mcap::kRecordHeadSize + length;
}

LeftFile::LeftFile(FileDescriptor fd, std::filesystem::path part, std::uint64_t size,
                   timespec written)
    : fd_(std::move(fd)), part_(std::move(part)), size_(size), written_(written) {}

Error LeftFile::io_error(const char* verb) const {
  return {ErrorCode::Io, fmt::format("{} {}: {}", verb, part_.string(), std::strerror(errno)), {}};
}

Result<std::optional<LeftFile>> LeftFile::open(const std::filesystem::path& part) {
  FileDescriptor fd{::open(part.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK)};
  struct stat status {};
  if (!fd && errno == ENOENT) return std::nullopt;
  if (!fd || ::fstat(fd.get(), &status) != 0)
    return fail(ErrorCode::Io, fmt::format("open {}: {}", part.string(), std::strerror(errno)));
  if (!S_ISREG(status.st_mode))
    return fail(ErrorCode::BadInput, fmt::format("open {}: is not a regular file", part.string()));
  if (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) return std::nullopt;
  return LeftFile{std::move(fd), part, static_cast<std::uint64_t>(status.st_size), status.st_mtim};
}

Result<std::vector<std::byte>> LeftFile::bytes(std::uint64_t offset, std::uint64_t length) const {
  std::vector<std::byte> out(static_cast<std::size_t>(length));
  std::size_t have = 0;
  while (have < out.size()) {
    const auto got =
        ::pread(fd_.get(), out.data() + have, out.size() - have, static_cast<off_t>(offset + have));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return tl::unexpected(io_error("read"));
    if (got == 0)
      return fail(ErrorCode::Io, fmt::format("read {}: the file became shorter while it was read",
                                             part_.string()));
    have += static_cast<std::size_t>(got);
  }
  return out;
}

/// The record head at `offset`; nullopt if the record there is truncated.
Result<std::optional<LeftFile::Head>> LeftFile::head_at(std::uint64_t offset) const {
  if (size_ - offset < mcap::kRecordHeadSize) return std::nullopt;
  const auto head = bytes(offset, mcap::kRecordHeadSize);
  ABBE_TRY(head);
  Head record{static_cast<mcap::Opcode>(head->front()), offset, 0};
  std::memcpy(&record.length, head->data() + 1, sizeof record.length);
  if (head->front() == std::byte{0} || record.length > size_ - offset - mcap::kRecordHeadSize)
    return std::nullopt;
  return record;
}

Result<void> LeftFile::read(const std::atomic<bool>& stop) {
  const auto magic = bytes(0, std::min<std::uint64_t>(size_, mcap::kMagic.size()));
  ABBE_TRY(magic);
  if (!std::ranges::equal(*magic, Bytes{mcap::kMagic}.first(magic->size())))
    return fail(ErrorCode::BadInput,
                fmt::format("{}: is not a recording: it does not begin with the MCAP magic",
                            part_.string()));
  whole_until_ = magic->size();

  while (!complete_ && whole_until_ < size_) {
    if (stop)
      return fail(
          ErrorCode::Io,
          fmt::format("{}: not closed: abbed was stopped while it read the file", part_.string()));
    const auto record = head_at(whole_until_);
    ABBE_TRY(record);
    if (!*record) break;
    if ((*record)->opcode == mcap::Opcode::DataEnd) {
      const auto last = bytes(size_ - mcap::kMagic.size(), mcap::kMagic.size());
      ABBE_TRY(last);
      complete_ = std::ranges::equal(*last, mcap::kMagic);
      break;  // complete_ stays false: the end of the file is truncated and is rewritten
    }
    ABBE_TRY(take(**record));
    whole_until_ = (*record)->end();
  }

  if (complete_) return end_chunk(), Result<void>{};
  ABBE_TRY(judge_tail());
  return judge_last_chunk();
}

Result<void> LeftFile::take(const Head& record) {
  if (record.opcode == mcap::Opcode::Chunk) return take_chunk(record);
  if (record.opcode != mcap::Opcode::MessageIndex) end_chunk();
  if (record.length > kLargestPiece)
    return fail(ErrorCode::BadInput, fmt::format("{}: a record of {} bytes at byte {}",
                                                 part_.string(), record.length, record.offset));
  const auto content = bytes(record.offset + mcap::kRecordHeadSize, record.length);
  ABBE_TRY(content);
  if (record.opcode == mcap::Opcode::MessageIndex) take_index(record, *content);
  if (record.opcode == mcap::Opcode::Metadata) take_metadata(record, *content);
  if (record.opcode == mcap::Opcode::Attachment) take_attachment(record, *content);
  if (record.opcode == mcap::Opcode::Schema)
    if (const auto schema = mcap::decode<mcap::Schema>(*content)) summary_.add(*schema);
  if (record.opcode == mcap::Opcode::Channel)
    if (const auto channel = mcap::decode<mcap::Channel>(*content)) summary_.add(*channel);

  return {};
}

Result<void> LeftFile::take_chunk(const Head& record) {
  end_chunk();
  const auto head =
      bytes(record.offset + mcap::kRecordHeadSize, std::min(record.length, kChunkHeadBytes));
  ABBE_TRY(head);
  const auto chunk = mcap::decode_cut_chunk(*head);
  chunk_ = OpenChunk{};
  chunk_->offset = record.offset;
  chunk_->length = record.end() - record.offset;
  if (chunk) chunk_->head = chunk->head;
  chunk_->head.compression = {};  // the bytes to which it refers are freed
  return {};
}

void LeftFile::take_index(const Head& record, Bytes content) {
  const auto index = mcap::decode<mcap::MessageIndex>(content);
  if (!chunk_ || !index) return;
  chunk_->shares.push_back(
      {index->channel_id, index->entries.size(), record.offset - chunk_->offset});
  chunk_->indexed += index->entries.size();
}

/// Adds a metadata record to the index of the summary, even if the record cannot be decoded: a
/// reader then finds and reports it.
void LeftFile::take_metadata(const Head& record, Bytes content) {
  const auto metadata = mcap::decode<mcap::Metadata>(content);
  summary_.add(mcap::MetadataIndex{record.offset, record.end() - record.offset,
                                   metadata ? metadata->name : std::string_view{"damaged"}});
}

void LeftFile::take_attachment(const Head& record, Bytes content) {
  has_attachments_ = true;
  mcap::AttachmentIndex index;
  index.offset = record.offset;
  index.length = record.end() - record.offset;
  index.name = "damaged";
  const auto attachment = mcap::decode<mcap::Attachment>(content);

  if (attachment) {
    index.log_time_ns = attachment->log_time_ns;
    index.create_time_ns = attachment->create_time_ns;
    index.data_size = attachment->data.size();
    index.name = attachment->name;
    index.media_type = attachment->media_type;
  }

  summary_.add(index);
}

void LeftFile::end_chunk() {
  if (!chunk_) return;
  const OpenChunk& chunk = *chunk_;
  summary_.add({.bytes = {},
                .length = whole_until_ - chunk.offset,
                .chunk_length = chunk.length,
                .records_size = chunk.head.records_size,
                .first_time_ns = chunk.head.first_time_ns,
                .last_time_ns = chunk.head.last_time_ns,
                .shares = chunk.shares},
               chunk.offset);
  chunk_.reset();
}

/// Decides what to do with the bytes after the last whole record:
/// - a truncated chunk: its whole messages are kept;
/// - another truncated record: it is discarded;
/// - zeros, which remain after a power cut if the file already had its new size: they are
///   discarded;
/// - anything else: the file is damaged.
Result<void> LeftFile::judge_tail() {
  if (whole_until_ == size_) return {};
  const auto damaged = [this] {
    return fail(ErrorCode::BadInput,
                fmt::format("{}: damaged at byte {}, {} bytes before its end; `abbe replay` can "
                            "read the data before the damage",
                            part_.string(), whole_until_, size_ - whole_until_));
  };

  const auto zeros = is_zero_from(whole_until_);
  ABBE_TRY(zeros);
  if (*zeros) return {};
  if (size_ - whole_until_ > kLargestPiece) return damaged();

  const auto tail = bytes(whole_until_, size_ - whole_until_);
  ABBE_TRY(tail);
  if (tail->front() == std::byte{0} || contains_whole_chunk(Bytes{*tail}.subspan(1)))
    return damaged();
  if (tail->front() != std::byte{static_cast<std::uint8_t>(mcap::Opcode::Chunk)} ||
      tail->size() <= mcap::kRecordHeadSize)
    return {};
  const auto chunk = mcap::decode_cut_chunk(Bytes{*tail}.subspan(mcap::kRecordHeadSize));
  if (!chunk || !chunk->head.compression.empty()) return {};
  end_chunk();
  rebuild(whole_until_, chunk->records);

  return {};
}

Result<bool> LeftFile::is_zero_from(std::uint64_t offset) const {
  constexpr std::uint64_t kPiece = 1 << 20;
  while (offset < size_) {
    const auto piece = bytes(offset, std::min(kPiece, size_ - offset));
    ABBE_TRY(piece);
    if (!std::ranges::all_of(*piece, [](std::byte b) { return b == std::byte{0}; })) return false;
    offset += piece->size();
  }
  return true;
}

/// Handles the last chunk, which is whole. Some of its indexes may be missing: then the chunk and
/// its indexes are written again.
Result<void> LeftFile::judge_last_chunk() {
  if (!chunk_) return {};
  if (chunk_->length > kLargestPiece) return end_chunk(), Result<void>{};
  const auto content =
      bytes(chunk_->offset + mcap::kRecordHeadSize, chunk_->length - mcap::kRecordHeadSize);
  ABBE_TRY(content);

  const auto chunk = mcap::decode<mcap::Chunk>(*content);
  const bool sound = chunk && chunk->head.compression.empty() &&
                     chunk->head.uncompressed_crc == mcap::crc32(chunk->records);
  std::uint64_t messages = 0;
  if (sound)
    for (mcap::MessageReader all{chunk->records}; all.next();) ++messages;
  if (!sound || messages == chunk_->indexed) return end_chunk(), Result<void>{};

  const auto offset = std::exchange(chunk_, std::nullopt)->offset;
  rebuild(offset, chunk->records);

  return {};
}

void LeftFile::rebuild(std::uint64_t offset, Bytes records) {
  mcap::ChunkBuilder builder{records.size()};
  mcap::MessageReader messages{records};
  while (const auto message = messages.next()) builder.add(*message);
  whole_until_ = offset;
  if (builder.empty()) return;
  const auto closed = builder.close();
  rebuilt_.assign(closed.bytes.begin(), closed.bytes.end());
  rebuilt_at_ = offset;
  whole_until_ += rebuilt_.size();
  summary_.add(closed, offset);
}

Result<void> LeftFile::write(std::uint64_t offset, Bytes piece) {
  while (!piece.empty()) {
    const auto n = ::pwrite(fd_.get(), piece.data(), piece.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return tl::unexpected(io_error("write"));
    piece = piece.subspan(static_cast<std::size_t>(n));
    offset += static_cast<std::uint64_t>(n);
  }
  return {};
}

Result<void> LeftFile::write_end() {
  if (!complete_) {
    // The order is: first the chunk, then the cut, then the end of the file. After a kill or on a
    // full disk the next start of abbed then finds a file that can still be closed.
    ABBE_TRY(write(rebuilt_at_, rebuilt_));
    if (::ftruncate(fd_.get(), static_cast<off_t>(whole_until_)) != 0)
      return tl::unexpected(io_error("truncate"));
    mcap::Buffer end;
    summary_.finish(whole_until_, end);
    if (auto done = write(whole_until_, end); !done) {
      (void)!::ftruncate(fd_.get(), static_cast<off_t>(whole_until_));
      return done;
    }
  }

  if (::fsync(fd_.get()) != 0) return tl::unexpected(io_error("fsync"));
  const std::array<timespec, 2> dates{timespec{0, UTIME_OMIT}, written_};
  (void)::futimens(fd_.get(), dates.data());

  return {};
}

}  // namespace abbe::daemon::recording
