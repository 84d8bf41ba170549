#include "observe/without_pass.hpp"

#include <algorithm>

namespace abbe::calib::mfb {
namespace {

/// Numbers the tools of a position consecutively from 0.
void renumber_tools(Observations& o, std::size_t position) {
  std::vector<std::size_t> known;
  for (PassObservation& pass : o.passes) {
    if (pass.position != position) {
      continue;
    }
    const auto at = std::find(known.begin(), known.end(), pass.tool);
    const auto number = static_cast<std::size_t>(at - known.begin());
    if (at == known.end()) {
      known.push_back(pass.tool);
    }
    pass.tool = number;
  }
}

/// Removes a pair: its remaining pass has no pair, and the numbers of later pairs decrease by one.
void remove_pair(Observations& o, std::size_t position, std::size_t pair) {
  for (PassObservation& pass : o.passes) {
    if (pass.position != position || !pass.pair) {
      continue;
    }
    if (*pass.pair == pair) {
      pass.pair.reset();
      pass.second_of_pair = false;
    } else if (*pass.pair > pair) {
      --*pass.pair;
    }
  }
}

}  // namespace

Observations without_pass(const Observations& all, std::size_t pass) {
  Observations o = all;
  const PassObservation removed = o.passes[pass];
  o.passes.erase(o.passes.begin() + static_cast<std::ptrdiff_t>(pass));
  if (removed.pair) {
    remove_pair(o, removed.position, *removed.pair);
  }
  renumber_tools(o, removed.position);

  const bool empty = std::none_of(o.passes.begin(), o.passes.end(), [&](const PassObservation& p) {
    return p.position == removed.position;
  });
  if (empty) {
    o.positions.erase(o.positions.begin() + static_cast<std::ptrdiff_t>(removed.position));
    for (PassObservation& p : o.passes) {
      p.position -= p.position > removed.position ? 1 : 0;
    }
  }
  return o;
}

}  // namespace abbe::calib::mfb
