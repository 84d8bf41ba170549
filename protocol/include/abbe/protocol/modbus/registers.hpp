#pragma once
/// Decodes one or two Modbus registers as a number. Registers are big-endian; the order of two
/// registers depends on the manufacturer. Pure, allocation-free; usable on the real-time path.

#include <cstddef>
#include <cstdint>
#include <span>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::modbus {

enum class RegisterType : std::uint8_t { Int16, Uint16, Int32, Uint32, Float32, Bcd16, Bcd32 };
enum class WordOrder : std::uint8_t { HighFirst, LowFirst };

[[nodiscard]] constexpr std::uint16_t register_count(RegisterType type) noexcept {
  return type == RegisterType::Int16 || type == RegisterType::Uint16 || type == RegisterType::Bcd16
             ? 1
             : 2;
}

/// The value in `bytes`, which has 2 * register_count(type) bytes. NaN for a Float32 that is not
/// finite and for BCD digits above 9.
[[nodiscard]] double decode_register(std::span<const std::byte> bytes, RegisterType type,
                                     WordOrder order) ABBE_RT;

}  // namespace abbe::protocol::modbus
