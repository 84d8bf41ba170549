#include "abbe/sim/fault.hpp"

#include <array>
#include <span>

namespace abbe::sim {
namespace {

struct Name {
  std::string_view name;
  FaultKind kind;
};

constexpr std::array kTrackerFaults{
    Name{"beam_break", FaultKind::BeamBreak},
    Name{"speed_exceeded", FaultKind::SpeedExceeded},
    Name{"prism_error", FaultKind::PrismError},
    Name{"stall", FaultKind::Stall},
    Name{"mute", FaultKind::Mute},
    Name{"reboot", FaultKind::Reboot},
    Name{"disconnect", FaultKind::Disconnect},
    Name{"busy", FaultKind::Busy},
    Name{"weather", FaultKind::Weather},
    Name{"garbage", FaultKind::TrackerGarbage},
};
constexpr std::array kEncoderFaults{
    Name{"mute", FaultKind::Mute},          Name{"late", FaultKind::Late},
    Name{"restart", FaultKind::Restart},    Name{"emergency", FaultKind::Emergency},
    Name{"garbage", FaultKind::BusGarbage}, Name{"bus_off", FaultKind::BusOff},
};

}  // namespace

std::optional<FaultKind> fault_kind(FaultTarget target, std::string_view name) {
  const std::span<const Name> names = target == FaultTarget::Tracker ? std::span<const Name>(kTrackerFaults)
                                                                     : std::span<const Name>(kEncoderFaults);
  for (const Name& candidate : names) {
    if (candidate.name == name) return candidate.kind;
  }
  return std::nullopt;
}

}  // namespace abbe::sim
