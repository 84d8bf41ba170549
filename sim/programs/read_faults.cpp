#include "read_faults.hpp"

#include <fmt/format.h>

#include <string>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/sim/environment_model.hpp"

namespace abbe::sim {
namespace {

namespace can = protocol::can;

ScheduledFault read_fault(Section& section) {
  ScheduledFault scheduled;
  std::string kind;
  section.get_word<FaultTarget>("device", scheduled.target,
                                {{"tracker", FaultTarget::Tracker},
                                 {"encoder", FaultTarget::Encoder},
                                 {"environment", FaultTarget::Environment},
                                 {"counter_card", FaultTarget::CounterCard},
                                 {"cmm", FaultTarget::MeasuringMachine},
                                 {"axis_lines", FaultTarget::AxisLines}},
                                Need::Required);
  section.get("kind", kind);
  const auto known = fault_kind(scheduled.target, kind);
  if (!known) section.fault("kind", fmt::format("\"{}\" is not a fault of this device", kind));
  scheduled.fault.kind = known.value_or(FaultKind::Mute);
  section.get("at_s", scheduled.fault.at_s, kPlain, kNotNegativeNumber, Need::Required);
  section.get("duration_s", scheduled.fault.duration_s, kPlain, kNotNegativeNumber);
  section.get("value", scheduled.fault.value, kPlain, kAnyNumber);
  section.get_integer("node", scheduled.fault.node, 0, can::kMaxNodeId);
  section.get_integer("input", scheduled.fault.input, 0, kSimulatedInputs);
  section.close(Hint::AllKeys);

  return scheduled;
}

}  // namespace

void read_faults(Section& sim, std::vector<ScheduledFault>& faults) {
  for (Section& section : sim.children("fault")) faults.push_back(read_fault(section));
}

}  // namespace abbe::sim
