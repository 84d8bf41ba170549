#pragma once
/// The records of an MCAP file [MCAP specification, mcap.dev/spec] as structs, with encoding and
/// decoding.
///
/// Decoding: the structs are views into the decoded bytes. Any bytes give a record or a
/// DecodeError. No allocation. Additional fields at the end, from a newer writer, are skipped.
///
/// Encoding: append(buffer, record) adds opcode, length and content to the caller's buffer. It
/// allocates only if the capacity is exceeded. All integers are little-endian. Precondition:
/// strings are shorter than 4 GiB (lengths are u32). Times are nanoseconds since the Unix epoch,
/// UTC. Pure; thread-safe.

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

namespace abbe::protocol::mcap {

using Bytes = std::span<const std::byte>;
using Buffer = std::vector<std::byte>;

/// First and last eight bytes of a file.
inline constexpr std::array<std::byte, 8> kMagic{std::byte{0x89}, std::byte{'M'}, std::byte{'C'},
                                                 std::byte{'A'},  std::byte{'P'}, std::byte{'0'},
                                                 std::byte{0x0D}, std::byte{0x0A}};

/// Size of opcode and content length, which precede the content of every record.
inline constexpr std::size_t kRecordHeadSize = 1 + 8;
/// Size of a complete Footer record.
inline constexpr std::size_t kFooterRecordSize = kRecordHeadSize + 8 + 8 + 4;

enum class Opcode : std::uint8_t {
  Header = 0x01,
  Footer = 0x02,
  Schema = 0x03,
  Channel = 0x04,
  Message = 0x05,
  Chunk = 0x06,
  MessageIndex = 0x07,
  ChunkIndex = 0x08,
  Attachment = 0x09,
  AttachmentIndex = 0x0A,
  Statistics = 0x0B,
  Metadata = 0x0C,
  MetadataIndex = 0x0D,
  SummaryOffset = 0x0E,
  DataEnd = 0x0F,
};

enum class DecodeError : std::uint8_t {
  Truncated,  ///< a field extends beyond the end of the content
  BadMap,     ///< the byte length of a map or array is not a whole number of entries
  BadCrc,     ///< the checksum of an attachment is wrong
};

template <class T>
using Decoded = tl::expected<T, DecodeError>;

/// The packed entries of an array or map of two integers, as in the file. The bytes need no
/// alignment.
template <class First, class Second>
class PackedPairs {
 public:
  static constexpr std::size_t kEntrySize = sizeof(First) + sizeof(Second);

  PackedPairs() = default;
  /// Views complete entries; a remainder shorter than one entry is ignored.
  explicit PackedPairs(Bytes bytes) noexcept
      : bytes_(bytes.first(bytes.size() / kEntrySize * kEntrySize)) {}

  [[nodiscard]] Bytes bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::size_t size() const noexcept { return bytes_.size() / kEntrySize; }
  [[nodiscard]] bool empty() const noexcept { return bytes_.empty(); }
  [[nodiscard]] std::pair<First, Second> operator[](std::size_t i) const noexcept {
    std::pair<First, Second> entry;
    std::memcpy(&entry.first, &bytes_[i * kEntrySize], sizeof(First));
    std::memcpy(&entry.second, &bytes_[i * kEntrySize + sizeof(First)], sizeof(Second));
    return entry;
  }

 private:
  Bytes bytes_;
};

/// A map<string, string> as in the file.
class StringMap {
 public:
  using Entry = std::pair<std::string_view, std::string_view>;

  StringMap() = default;
  /// Views packed entries as written by pack(), without the length of the whole map.
  explicit StringMap(Bytes packed) noexcept : bytes_(packed) {}
  [[nodiscard]] Bytes bytes() const noexcept { return bytes_; }
  /// Removes and returns the first entry; nullopt if there is none or if it is incomplete.
  [[nodiscard]] std::optional<Entry> take() noexcept;
  [[nodiscard]] std::optional<std::string_view> find(std::string_view key) const noexcept;
  /// Appends the packed entry to `buffer`. A StringMap can then view the buffer.
  static void pack(Buffer& buffer, std::string_view key, std::string_view value);

 private:
  Bytes bytes_;
};

struct Header {
  std::string_view profile;
  std::string_view library;
};

struct Footer {
  std::uint64_t summary_start = 0;         ///< 0: no summary
  std::uint64_t summary_offset_start = 0;  ///< 0: no summary offsets
  /// checksum from summary_start to the last byte of the field summary_offset_start; 0: none
  std::uint32_t summary_crc = 0;
};

struct Schema {
  std::uint16_t id = 0;  ///< never 0 in a file
  std::string_view name;
  std::string_view encoding;
  Bytes data;
};

struct Channel {
  std::uint16_t id = 0;
  std::uint16_t schema_id = 0;
  std::string_view topic;
  std::string_view message_encoding;
  StringMap metadata;
};

struct Message {
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time_ns = 0;
  std::uint64_t publish_time_ns = 0;
  Bytes data;
};

/// The fields of a Chunk record before its records.
struct ChunkHead {
  std::uint64_t first_time_ns = 0;
  std::uint64_t last_time_ns = 0;
  std::uint64_t uncompressed_size = 0;
  std::uint32_t uncompressed_crc = 0;  ///< 0: none
  std::string_view compression;        ///< empty: none, the only one supported here
  /// number of bytes of the records that follow; a truncated file has fewer
  std::uint64_t records_size = 0;
};

struct Chunk {
  ChunkHead head;
  Bytes records;
};

struct MessageIndex {
  std::uint16_t channel_id = 0;
  /// Pairs of log time (ns) and offset in the uncompressed records.
  PackedPairs<std::uint64_t, std::uint64_t> entries;
};

struct ChunkIndex {
  std::uint64_t first_time_ns = 0;
  std::uint64_t last_time_ns = 0;
  std::uint64_t chunk_start = 0;   ///< offset of the Chunk's opcode in the file
  std::uint64_t chunk_length = 0;  ///< length of the whole Chunk record
  /// Pairs of channel id and offset of the channel's MessageIndex record in the file.
  PackedPairs<std::uint16_t, std::uint64_t> index_offsets;
  std::uint64_t index_length = 0;  ///< total length of the MessageIndex records
  std::string_view compression;
  std::uint64_t compressed_size = 0;
  std::uint64_t uncompressed_size = 0;
};

struct Attachment {
  std::uint64_t log_time_ns = 0;
  std::uint64_t create_time_ns = 0;
  std::string_view name;
  std::string_view media_type;
  Bytes data;
};

struct AttachmentIndex {
  std::uint64_t offset = 0;
  std::uint64_t length = 0;  ///< length of the whole Attachment record
  std::uint64_t log_time_ns = 0;
  std::uint64_t create_time_ns = 0;
  std::uint64_t data_size = 0;
  std::string_view name;
  std::string_view media_type;
};

struct Statistics {
  std::uint64_t message_count = 0;
  std::uint16_t schema_count = 0;
  std::uint32_t channel_count = 0;
  std::uint32_t attachment_count = 0;
  std::uint32_t metadata_count = 0;
  std::uint32_t chunk_count = 0;
  std::uint64_t first_time_ns = 0;
  std::uint64_t last_time_ns = 0;
  PackedPairs<std::uint16_t, std::uint64_t> channel_message_counts;
};

struct Metadata {
  std::string_view name;
  StringMap entries;
};

struct MetadataIndex {
  std::uint64_t offset = 0;
  std::uint64_t length = 0;  ///< length of the whole Metadata record
  std::string_view name;
};

struct SummaryOffset {
  Opcode group = Opcode::Header;
  std::uint64_t start = 0;
  std::uint64_t length = 0;
};

struct DataEnd {
  std::uint32_t data_section_crc = 0;  ///< 0: none
};

/// Decodes the content of a record (without opcode and length) as a T; defined for every struct
/// above except ChunkHead. decode<Chunk> requires all bytes of the chunk's records and does not
/// check their checksum.
template <class T>
[[nodiscard]] Decoded<T> decode(Bytes content) noexcept = delete;

template <>
[[nodiscard]] Decoded<Header> decode<Header>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<Footer> decode<Footer>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<Schema> decode<Schema>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<Channel> decode<Channel>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<Message> decode<Message>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<Chunk> decode<Chunk>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<MessageIndex> decode<MessageIndex>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<ChunkIndex> decode<ChunkIndex>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<Attachment> decode<Attachment>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<AttachmentIndex> decode<AttachmentIndex>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<Statistics> decode<Statistics>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<Metadata> decode<Metadata>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<MetadataIndex> decode<MetadataIndex>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<SummaryOffset> decode<SummaryOffset>(Bytes content) noexcept;
template <>
[[nodiscard]] Decoded<DataEnd> decode<DataEnd>(Bytes content) noexcept;

/// Decodes a chunk whose records may be truncated: `records` contains the existing bytes.
[[nodiscard]] Decoded<Chunk> decode_cut_chunk(Bytes content) noexcept;

void append_magic(Buffer& buffer);
void append(Buffer& buffer, const Header& record);
void append(Buffer& buffer, const Footer& record);
void append(Buffer& buffer, const Schema& record);
void append(Buffer& buffer, const Channel& record);
void append(Buffer& buffer, const Message& record);
/// Appends a Chunk record. Its records_size is the size of `records`; its checksum is taken from
/// the head.
void append(Buffer& buffer, const Chunk& record);
void append(Buffer& buffer, const MessageIndex& record);
void append(Buffer& buffer, const ChunkIndex& record);
void append(Buffer& buffer, const Attachment& record);
void append(Buffer& buffer, const AttachmentIndex& record);
void append(Buffer& buffer, const Statistics& record);
void append(Buffer& buffer, const Metadata& record);
void append(Buffer& buffer, const MetadataIndex& record);
void append(Buffer& buffer, const SummaryOffset& record);
void append(Buffer& buffer, const DataEnd& record);

}  // namespace abbe::protocol::mcap
