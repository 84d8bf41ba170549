#pragma once
/// Everybody behind the device that reads the axes takes an axis by its place in a sample: the
/// order in the file must not matter.

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/config/section.hpp"

namespace abbe::daemon {

/// Puts what reads the axes (each with its axis' name at `name`) in the order of the machine.
/// Faults what is missing of X, Y and Z: "axis Y has no node".
template <class Reads>
void put_in_order_of_the_machine(const MachineConfig& machine, std::string Reads::*name,
                                 Section& device, std::string_view key, std::string_view what,
                                 std::vector<Reads>& all) {
  for (const std::string needed : {"X", "Y", "Z"})
    if (std::ranges::find(all, needed, name) == all.end())
      device.fault(key, fmt::format("axis {} has no {}", needed, what));
  const auto known = [&](const Reads& one) { return machine.find_axis(one.*name) != nullptr; };
  if (!std::ranges::all_of(all, known)) return;  // said already
  const auto place = [&](const Reads& one) {
    return machine.find_axis(one.*name) - machine.axes.data();
  };
  std::ranges::stable_sort(all, {}, place);
}

}  // namespace abbe::daemon
