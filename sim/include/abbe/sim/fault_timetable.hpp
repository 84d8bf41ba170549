#pragma once
/// Faults at their times after the start of the machine's motion. Not thread-safe.

#include <vector>

#include "abbe/sim/fault.hpp"
#include "abbe/sim/virtual_machine.hpp"

namespace abbe::sim {

class FaultTimetable {
 public:
  void add(const ScheduledFault& fault);  ///< in any order, before the first is taken

  /// max(): none is left, or the machine has not begun.
  [[nodiscard]] HostTime next_due(const VirtualMachine& machine) const;
  /// The next one whose time has come; nullptr: none. Valid until add().
  [[nodiscard]] const ScheduledFault* take_due(const VirtualMachine& machine, HostTime now);

 private:
  std::vector<ScheduledFault> faults_;  ///< by time
  std::size_t next_ = 0;
};

}  // namespace abbe::sim
