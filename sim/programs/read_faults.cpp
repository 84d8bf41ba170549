#include "read_faults.hpp"

#include <fmt/format.h>

#include <optional>
#include <string>
#include <string_view>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/sim/environment_model.hpp"

namespace abbe::sim {
namespace {

namespace can = protocol::can;

std::optional<FaultTarget> target_of(std::string_view device) {
  if (device == "tracker") return FaultTarget::Tracker;
  if (device == "encoder") return FaultTarget::Encoder;
  if (device == "environment") return FaultTarget::Environment;
  if (device == "counter_card") return FaultTarget::CounterCard;
  if (device == "cmm") return FaultTarget::MeasuringMachine;
  return std::nullopt;
}

ScheduledFault read_fault(TomlSection& section) {
  ScheduledFault scheduled;
  std::string device, kind;
  std::int64_t node = 0;
  section.text("device", device);
  section.text("kind", kind);

  if (const auto target = target_of(device)) {
    scheduled.target = *target;
  } else {
    section.fault("device",
                  "must be \"tracker\", \"encoder\", \"environment\", \"counter_card\" or \"cmm\"");
  }

  const auto known = fault_kind(scheduled.target, kind);
  if (!known) section.fault("kind", fmt::format("\"{}\" is not a fault of this device", kind));
  scheduled.fault.kind = known.value_or(FaultKind::Mute);
  if (!section.number("at_s", scheduled.fault.at_s, 1.0, kNotNegativeNumber))
    section.fault("at_s", "missing");
  section.number("duration_s", scheduled.fault.duration_s, 1.0, kNotNegativeNumber);
  section.number("value", scheduled.fault.value);
  if (section.integer("node", node, 0, can::kMaxNodeId))
    scheduled.fault.node = static_cast<std::uint8_t>(node);
  if (std::int64_t input = 0; section.integer("input", input, 0, kSimulatedInputs))
    scheduled.fault.input = static_cast<std::uint8_t>(input);
  section.refuse_unknown_keys();

  return scheduled;
}

}  // namespace

void read_faults(TomlSection& sim, std::vector<ScheduledFault>& faults) {
  for (TomlSection& section : sim.children("fault")) faults.push_back(read_fault(section));
}

}  // namespace abbe::sim
