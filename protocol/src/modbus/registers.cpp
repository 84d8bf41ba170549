#include "abbe/protocol/modbus/registers.hpp"

#include <bit>
#include <cmath>
#include <limits>

#include "abbe/protocol/bytes.hpp"

namespace abbe::protocol::modbus {
namespace {

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

std::uint32_t word(std::span<const std::byte> bytes, RegisterType type, WordOrder order) ABBE_RT {
  ByteReader reader{bytes};
  const std::uint32_t first = reader.big<std::uint16_t>();
  if (register_count(type) == 1) return first;
  const std::uint32_t second = reader.big<std::uint16_t>();
  return order == WordOrder::HighFirst ? first << 16 | second : second << 16 | first;
}

double from_bcd(std::uint32_t digits) ABBE_RT {
  double value = 0.0;
  for (int shift = 28; shift >= 0; shift -= 4) {
    const std::uint32_t digit = digits >> shift & 0xFu;
    if (digit > 9) return kNotANumber;
    value = 10.0 * value + digit;
  }
  return value;
}

}  // namespace

double decode_register(std::span<const std::byte> bytes, RegisterType type,
                       WordOrder order) ABBE_RT {
  const std::uint32_t bits = word(bytes, type, order);
  switch (type) {
    case RegisterType::Int16:
      return static_cast<std::int16_t>(bits);
    case RegisterType::Int32:
      return static_cast<std::int32_t>(bits);
    case RegisterType::Uint16:
    case RegisterType::Uint32:
      return bits;
    case RegisterType::Float32: {
      const float value = std::bit_cast<float>(bits);
      return std::isfinite(value) ? static_cast<double>(value) : kNotANumber;
    }
    case RegisterType::Bcd16:
    case RegisterType::Bcd32:
      return from_bcd(bits);
  }
  return kNotANumber;
}

}  // namespace abbe::protocol::modbus
