#pragma once
/// The structure of messages with DDS Security [DDS Security 1.1, 7.3.6.6 and 7.3.7]. Fast DDS 2.9
/// computes with lengths that a message only states before it checks a signature, so a message with
/// another structure must be dropped:
///     SRTPS_PREFIX, submessages with explicit lengths, SRTPS_POSTFIX     a signed message
///     SEC_PREFIX, one submessage with an explicit length, SEC_POSTFIX    a protected submessage

#include <cstdint>
#include <optional>
#include <span>

namespace abbe::dds {

/// Follows the submessages of one message from the first to the last.
class ProtectedStructure {
 public:
  /// Takes the next submessage. `first`: it is the first of the message. `open`: its length is 0,
  /// "up to the end". Returns true if the submessage is protected: Fast DDS drops it if its
  /// signature is wrong. nullopt: the structure is wrong.
  [[nodiscard]] std::optional<bool> next(std::uint8_t kind, std::span<const std::uint8_t> body,
                                         bool first, bool open);
  /// True if every structure that began has also ended.
  [[nodiscard]] bool is_complete() const;

 private:
  /// Signed: after SRTPS_PREFIX; Ended: after SRTPS_POSTFIX
  enum class Message { Plain, Signed, Ended };
  /// Begun: after SEC_PREFIX; HasContent: after the protected submessage
  enum class Submessage { None, Begun, HasContent };

  Message message_ = Message::Plain;
  Submessage submessage_ = Submessage::None;
};

}  // namespace abbe::dds
