#pragma once
/// observe() followed by solve(). The caller calls judge(), which also needs the active model and
/// the limits of the gate.

#include "abbe/calib/otf/judge.hpp"

namespace abbe::calib::otf {

struct Identification {
  Observations observations;
  Solution solution;
};
/// Pure and deterministic: the same input gives bit-identical results.
[[nodiscard]] Result<Identification> identify(std::span<const TrackerObservation>, const Machine&,
                                              const Path&, const Noise&, const Options& = {});

}  // namespace abbe::calib::otf
