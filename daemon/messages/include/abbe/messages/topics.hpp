#pragma once
/// The topics abbe publishes over DDS, as abbed and abbe-dds both see them: number on the local
/// socket, names, how long a sample counts, and where the key stands in a payload. The QoS that
/// follows from it lives in abbe-dds. Pure, thread-safe, no allocation.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace abbe::daemon {

/// The values cross the local socket: append only.
enum class Topic : std::uint8_t {
  Snapshot = 0,
  Compensation = 1,
  ErrorModel = 2,
  ErrorGrid = 3,
  ModelState = 4,
  Health = 5,
  CalibrationEvent = 6,
};
inline constexpr std::size_t kTopicCount = 7;

/// before the payload: representation and options
inline constexpr std::size_t kCdrHeaderBytes = 4;

struct TopicTraits {
  /// Live: only the newest sample counts, best effort, dropped rather than queued.
  /// Durable: the newest per key is kept, sent again to whoever comes late, and repeated.
  enum class Kind : std::uint8_t { Live, Durable };
  /// Which leading members are the key of the IDL type.
  enum class Key : std::uint8_t { Machine, MachineAndNumber, MachineAndText };

  Topic topic;
  std::string_view name;       ///< "abbe/v1/Snapshot"
  std::string_view type_name;  ///< "abbe::v1::Snapshot"
  Kind kind;
  Key key;
  std::chrono::milliseconds
      repeat{};  ///< durable: published at least this often, so that a missed late joiner heals
};

[[nodiscard]] const TopicTraits& traits(Topic topic) noexcept;
[[nodiscard]] std::span<const TopicTraits> all_topics() noexcept;
[[nodiscard]] std::optional<Topic> topic_from(std::uint8_t value) noexcept;

/// The key of a payload (CDR_LE with its 4-byte header): the leading members, exactly as they stand
/// in the payload. Nothing if the bytes are not a payload or end within the key.
struct PayloadKey {
  std::span<const std::byte>
      bytes;  ///< after the header up to the end of the key; equal bytes = same instance
  std::string_view machine;              ///< without its NUL
  std::optional<std::string_view> text;  ///< MachineAndText: the second text
  std::optional<std::uint32_t> number;   ///< MachineAndNumber: the number
};
[[nodiscard]] std::optional<PayloadKey> payload_key(Topic topic,
                                                    std::span<const std::byte> payload) noexcept;

/// How many slices the grid has that this payload of ErrorGrid is a part of. Nothing if it is none.
[[nodiscard]] std::optional<std::uint32_t> grid_slices(std::span<const std::byte> payload) noexcept;

/// Writes sequence_number of a payload of ErrorModel or ErrorGrid, in place. False, and nothing
/// changed, if it is none.
[[nodiscard]] bool set_sequence_number(Topic topic, std::span<std::byte> payload,
                                       std::uint64_t number) noexcept;

/// Adds to age_ns of a payload of Compensation, in place. False, and nothing changed, if it is
/// none.
[[nodiscard]] bool add_to_age(std::span<std::byte> compensation,
                              std::chrono::nanoseconds more) noexcept;

}  // namespace abbe::daemon
