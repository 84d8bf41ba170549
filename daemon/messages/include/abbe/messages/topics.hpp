#pragma once
/// The topics that abbe publishes over DDS, as abbed and abbe-dds use them: number on the local
/// socket, names, kind, and position of the key in a payload. abbe-dds derives the QoS from these
/// traits. Pure, thread-safe, no allocation.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace abbe::daemon {

/// The values are sent over the local socket: append only.
enum class Topic : std::uint8_t {
  Snapshot = 0,
  Compensation = 1,
  ErrorModel = 2,
  ErrorGrid = 3,
  ModelState = 4,
  Health = 5,
  CalibrationEvent = 6,
  Identity = 7,
};
inline constexpr std::size_t kTopicCount = 8;

/// Encapsulation header of a payload: representation identifier and options.
inline constexpr std::size_t kCdrHeaderBytes = 4;

struct TopicTraits {
  /// Live: only the newest sample is of use; best effort; a sample is dropped, not queued.
  /// Durable: the newest sample per key is retained, sent to late joiners, and repeated.
  enum class Kind : std::uint8_t { Live, Durable };
  /// The leading members of the IDL type that form the DDS key of the topic: machine alone, or
  /// machine and a number or text.
  enum class Key : std::uint8_t { Machine, MachineAndNumber, MachineAndText };

  Topic topic;
  std::string_view name;       ///< "abbe/v1/Snapshot"
  std::string_view type_name;  ///< "abbe::v1::Snapshot"
  Kind kind;
  Key key;
  /// Period with which a durable topic is repeated, for a late joiner that missed a sample.
  std::chrono::milliseconds repeat{};
};

[[nodiscard]] const TopicTraits& traits(Topic topic) noexcept;
[[nodiscard]] std::span<const TopicTraits> all_topics() noexcept;
[[nodiscard]] std::optional<Topic> topic_from(std::uint8_t value) noexcept;

/// The key of a payload (CDR_LE with its 4-byte header): the bytes of the leading members in the
/// payload. nullopt if the bytes are not a payload or end within the key.
struct PayloadKey {
  /// The bytes of the payload from after its header to the end of the key. Payloads with equal
  /// bytes belong to the same DDS instance.
  std::span<const std::byte> bytes;
  std::string_view machine;              ///< machine name without its NUL
  std::optional<std::string_view> text;  ///< for MachineAndText: the second text
  std::optional<std::uint32_t> number;   ///< for MachineAndNumber: the number
};
[[nodiscard]] std::optional<PayloadKey> payload_key(Topic topic,
                                                    std::span<const std::byte> payload) noexcept;

/// Number of slices of the grid that this ErrorGrid payload belongs to. nullopt if `payload` is not
/// an ErrorGrid.
[[nodiscard]] std::optional<std::uint32_t> grid_slices(std::span<const std::byte> payload) noexcept;

/// Sets sequence_number in a payload of ErrorModel or ErrorGrid, in place. Returns false and
/// changes nothing if `payload` is neither of them.
[[nodiscard]] bool set_sequence_number(Topic topic, std::span<std::byte> payload,
                                       std::uint64_t number) noexcept;

/// Adds `more` to age_ns in a payload of Compensation, in place. Returns false and changes nothing
/// if `compensation` is not such a payload.
[[nodiscard]] bool add_to_age(std::span<std::byte> compensation,
                              std::chrono::nanoseconds more) noexcept;

}  // namespace abbe::daemon
