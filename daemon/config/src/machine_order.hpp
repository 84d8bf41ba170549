#pragma once
/// Brings the axes of a device into the order of the machine's axes. The users of a sample select
/// an axis by its index, so the index must not depend on the order of axes in the configuration
/// file.

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "classified_section.hpp"

namespace abbe::daemon {

/// Sorts the elements that read the axes (nodes or channels; the member `name` holds the axis name)
/// in the order of the machine's axes. Adds a fault for each of X, Y and Z that is missing: "axis Y
/// has no node".
template <class Reads>
void put_in_order_of_the_machine(const MachineConfig& machine, std::string Reads::*name,
                                 ClassifiedSection& device, std::string_view key,
                                 std::string_view what, std::vector<Reads>& all) {
  for (const std::string needed : {"X", "Y", "Z"})
    if (std::ranges::find(all, needed, name) == all.end())
      device.fault(key, fmt::format("axis {} has no {}", needed, what));
  const auto known = [&](const Reads& one) { return machine.find_axis(one.*name) != nullptr; };
  if (!std::ranges::all_of(all, known)) return;  // an unknown axis is reported already
  const auto place = [&](const Reads& one) {
    return machine.find_axis(one.*name) - machine.axes.data();
  };
  std::ranges::stable_sort(all, {}, place);
}

}  // namespace abbe::daemon
