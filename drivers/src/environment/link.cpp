#include "abbe/drivers/environment/link.hpp"

#include <filesystem>
#include <system_error>

namespace abbe::drivers {
namespace {

constexpr int kFastLine_baud = 19200;  // at higher baud rates the silent interval is constant
constexpr std::chrono::nanoseconds kShortestSilence = std::chrono::microseconds{1750};
constexpr std::int64_t kBitsOfSilence_tenths = 385;  // 3.5 characters of 11 bits

std::filesystem::path real_path(const std::string& path) {
  std::error_code failed;
  auto real = std::filesystem::weakly_canonical(path, failed);
  return failed ? std::filesystem::path{path} : real;
}

}  // namespace

bool same_line(const ModbusAddress& a, const ModbusAddress& b) {
  if (a.index() != b.index()) return false;
  if (const auto* tcp = std::get_if<ModbusTcp>(&a)) {
    const auto& other = std::get<ModbusTcp>(b);
    return tcp->host == other.host && tcp->port == other.port;
  }
  return real_path(std::get<ModbusSerial>(a).path) == real_path(std::get<ModbusSerial>(b).path);
}

bool same_settings(const ModbusAddress& a, const ModbusAddress& b) {
  const auto* one = std::get_if<ModbusSerial>(&a);
  const auto* other = std::get_if<ModbusSerial>(&b);
  if (one == nullptr || other == nullptr) return one == other;
  return one->baud == other->baud && one->parity == other->parity &&
         one->stop_bits == other->stop_bits;
}

std::chrono::nanoseconds silence_between(const ModbusAddress& address) {
  const auto* serial = std::get_if<ModbusSerial>(&address);
  if (serial == nullptr) return {};
  if (serial->baud > kFastLine_baud) return kShortestSilence;
  return std::chrono::nanoseconds{kBitsOfSilence_tenths * 100'000'000 / serial->baud};
}

}  // namespace abbe::drivers
