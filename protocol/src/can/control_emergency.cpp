#include "abbe/protocol/can/control_emergency.hpp"

#include <algorithm>
#include <array>
#include <span>

namespace abbe::protocol::can {
namespace {

constexpr std::uint16_t kCode = 0xFF01;
constexpr std::array kSignature{std::byte{'L'}, std::byte{'C'}, std::byte{'N'}, std::byte{'C'}};

}  // namespace

const char* to_text(ControlCause cause) noexcept {
  switch (cause) {
    case ControlCause::NotHomed:
      return "LinuxCNC is not homed";
    case ControlCause::NoPosition:
      return "LinuxCNC reports no position that can be sent";
  }
  return "unknown cause";
}

Emergency control_emergency(NodeId node, std::optional<ControlCause> cause) {
  Emergency emergency{.node = node, .code = 0, .error_register = 0, .manufacturer = {}};
  if (!cause) return emergency;
  emergency.code = kCode;
  emergency.error_register = static_cast<std::uint8_t>(ErrorRegister::Generic) |
                             static_cast<std::uint8_t>(ErrorRegister::Manufacturer);
  std::ranges::copy(kSignature, emergency.manufacturer.begin());
  emergency.manufacturer.back() = static_cast<std::byte>(*cause);
  return emergency;
}

std::optional<ControlCause> control_cause(const Emergency& emergency) {
  if (emergency.code != kCode ||
      !std::ranges::equal(kSignature, std::span{emergency.manufacturer}.first<4>()))
    return std::nullopt;
  const auto cause = static_cast<ControlCause>(emergency.manufacturer.back());
  if (cause != ControlCause::NotHomed && cause != ControlCause::NoPosition) return std::nullopt;
  return cause;
}

}  // namespace abbe::protocol::can
