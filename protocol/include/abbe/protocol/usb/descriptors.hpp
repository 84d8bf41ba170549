#pragma once
/// Descriptors of a USB device: device descriptor, strings, and endpoints [USB 2.0] 9.6. The
/// decoders accept any bytes. Pure, no allocation.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::usb {

struct DeviceDescriptor {
  std::uint16_t usb_version = 0x0200;
  std::uint8_t device_class = 0xFF;
  std::uint8_t device_subclass = 0;
  std::uint8_t device_protocol = 0;
  std::uint8_t packet_size0 = 64;
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::uint16_t device_version = 0x0100;
  std::uint8_t manufacturer_string = 0;  ///< number of a string descriptor; 0: none
  std::uint8_t product_string = 0;
  std::uint8_t serial_string = 0;
  std::uint8_t configurations = 1;
  friend bool operator==(const DeviceDescriptor&, const DeviceDescriptor&) = default;
};
inline constexpr std::size_t kDeviceDescriptorSize = 18;
[[nodiscard]] std::array<std::byte, kDeviceDescriptorSize> encode(
    const DeviceDescriptor& descriptor) ABBE_RT;
/// nullopt if `bytes` are too few or not a device descriptor.
[[nodiscard]] std::optional<DeviceDescriptor> decode_device_descriptor(
    std::span<const std::byte> bytes) ABBE_RT;

/// A string descriptor as text; a character that is not printable ASCII becomes '?'.
struct DescriptorText {
  /// A descriptor has at most 255 bytes, two of them per character.
  static constexpr std::size_t kCapacity = 126;
  std::array<char, kCapacity> characters{};
  std::size_t length = 0;
  [[nodiscard]] std::string_view view() const noexcept { return {characters.data(), length}; }
};
[[nodiscard]] std::optional<DescriptorText> decode_string(std::span<const std::byte> bytes) ABBE_RT;
inline constexpr std::size_t kMaxDescriptor = 255;
/// Writes ASCII as a string descriptor and returns its size. Text that exceeds the longest
/// descriptor is truncated.
std::size_t encode_string(std::string_view ascii, std::span<std::byte, kMaxDescriptor> out) ABBE_RT;

/// Finds the endpoint with this address in the descriptors of a configuration; returns its largest
/// packet size in bytes.
[[nodiscard]] std::optional<std::uint16_t> find_endpoint(std::span<const std::byte> configuration,
                                                         std::uint8_t address) ABBE_RT;

}  // namespace abbe::protocol::usb
