#pragma once
/// Little-endian numbers of any width in frames (an SDO value has 1 to 8 bytes, also 3): the byte
/// order of CANopen [CiA 301]. Precondition: the caller has checked the bounds.

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

namespace abbe::protocol::can {

template <std::unsigned_integral T>
[[nodiscard]] constexpr T load_le(std::span<const std::byte> bytes, std::size_t offset = 0,
                                  std::size_t size = sizeof(T)) noexcept {
  T value = 0;
  for (std::size_t i = 0; i < size; ++i) {
    value = static_cast<T>(
        value | (static_cast<T>(std::to_integer<std::uint8_t>(bytes[offset + i])) << (8 * i)));
  }
  return value;
}

template <std::unsigned_integral T>
constexpr void store_le(std::span<std::byte> bytes, std::size_t offset, T value,
                        std::size_t size = sizeof(T)) noexcept {
  for (std::size_t i = 0; i < size; ++i)
    bytes[offset + i] = static_cast<std::byte>((value >> (8 * i)) & 0xFFu);
}

}  // namespace abbe::protocol::can
