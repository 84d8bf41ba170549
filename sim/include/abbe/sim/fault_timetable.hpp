#pragma once
/// Scheduled faults, in order of their time after the start of the machine's motion. Not
/// thread-safe.

#include <vector>

#include "abbe/sim/fault.hpp"
#include "abbe/sim/virtual_machine.hpp"

namespace abbe::sim {

class FaultTimetable {
 public:
  /// faults may be added in any order, but only before the first take_due()
  void add(const ScheduledFault& fault);

  /// Time of the next fault; HostTime::max(): no fault is left, or the machine has not started to
  /// move.
  [[nodiscard]] HostTime next_due(const VirtualMachine& machine) const;
  /// The next fault if it is due, else nullptr. Valid until add().
  [[nodiscard]] const ScheduledFault* take_due(const VirtualMachine& machine, HostTime now);

 private:
  std::vector<ScheduledFault> faults_;  ///< ordered by time
  std::size_t next_ = 0;
};

}  // namespace abbe::sim
