#pragma once
/// The setup packet (eight bytes) of a control transfer, and the standard requests used here.
/// [USB 2.0] 9.3, 9.4. Little-endian on the wire. Pure, no allocation.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::usb {

struct Setup {
  std::uint8_t request_type = 0;
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  std::uint16_t length = 0;

  [[nodiscard]] constexpr bool device_to_host() const noexcept {
    return (request_type & 0x80u) != 0;
  }
  friend constexpr bool operator==(const Setup&, const Setup&) = default;
};

inline constexpr std::size_t kSetupSize = 8;
using SetupBytes = std::array<std::byte, kSetupSize>;
[[nodiscard]] SetupBytes encode(const Setup& setup) ABBE_RT;
[[nodiscard]] Setup decode_setup(std::span<const std::byte, kSetupSize> bytes) ABBE_RT;

inline constexpr std::uint8_t kInEndpoint = 0x80;  ///< bit of an endpoint address: device to host

enum class StandardRequest : std::uint8_t {
  GetStatus = 0,
  ClearFeature = 1,
  SetFeature = 3,
  SetAddress = 5,
  GetDescriptor = 6,
  GetConfiguration = 8,
  SetConfiguration = 9,
  GetInterface = 10,
  SetInterface = 11,
};
enum class DescriptorType : std::uint8_t {
  Device = 1,
  Configuration = 2,
  String = 3,
  Interface = 4,
  Endpoint = 5,
};
inline constexpr std::uint16_t kEnglish = 0x0409;

[[nodiscard]] constexpr Setup get_descriptor(DescriptorType type, std::uint8_t number,
                                             std::uint16_t length) noexcept {
  const auto value = static_cast<std::uint16_t>(static_cast<unsigned>(type) << 8 | number);
  const std::uint16_t language = type == DescriptorType::String && number != 0 ? kEnglish : 0;
  return {0x80, static_cast<std::uint8_t>(StandardRequest::GetDescriptor), value, language, length};
}
[[nodiscard]] constexpr Setup set_configuration(std::uint8_t value) noexcept {
  return {0x00, static_cast<std::uint8_t>(StandardRequest::SetConfiguration), value, 0, 0};
}
/// Clears the halt of an endpoint; the host must also reset its data toggle.
[[nodiscard]] constexpr Setup clear_halt(std::uint8_t endpoint) noexcept {
  return {0x02, static_cast<std::uint8_t>(StandardRequest::ClearFeature), 0, endpoint, 0};
}

}  // namespace abbe::protocol::usb
