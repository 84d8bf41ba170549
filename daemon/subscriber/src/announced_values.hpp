#pragma once
/// Checks the lengths inside the values that any participant may announce. Fast DDS 2.9 reads text
/// beyond the end of a value, and allocates memory for as many elements as the value states: four
/// octets are enough for 8 GB.

#include <cstdint>
#include <span>

namespace abbe::dds {

/// True if the value of the parameter `id` of an announcement [DDSI-RTPS 2.5, 9.6.3; DDS Security
/// 1.1, 7.4.1] has the length of its type, and contains the elements and the text that it states.
/// True for parameters that Fast DDS does not read. An announcement that Fast DDS refuses stays in
/// its memory.
[[nodiscard]] bool has_valid_lengths(std::uint16_t id, std::span<const std::uint8_t> value,
                                     bool little_endian);

/// The same check for a message of authentication, which arrives before any signature is checked: a
/// ParticipantGenericMessage after its encapsulation [DDS Security 1.1, 7.4.3.5].
[[nodiscard]] bool authentication_has_valid_lengths(std::span<const std::uint8_t> message,
                                                    bool little_endian);

}  // namespace abbe::dds
