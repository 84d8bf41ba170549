#include "abbe/sim/fault_timetable.hpp"

#include <algorithm>

namespace abbe::sim {

void FaultTimetable::add(const ScheduledFault& fault) {
  const auto later =
      std::upper_bound(faults_.begin(), faults_.end(), fault.fault.at_s,
                       [](double at_s, const auto& f) { return at_s < f.fault.at_s; });
  faults_.insert(later, fault);
}

HostTime FaultTimetable::next_due(const VirtualMachine& machine) const {
  const auto started = machine.started();
  if (!started || next_ == faults_.size()) return HostTime::max();
  return *started + seconds_to_ns(faults_[next_].fault.at_s);
}

const ScheduledFault* FaultTimetable::take_due(const VirtualMachine& machine, HostTime now) {
  return next_due(machine) > now ? nullptr : &faults_[next_++];
}

}  // namespace abbe::sim
