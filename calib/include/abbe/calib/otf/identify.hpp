#pragma once
/// observe, solve and judge in a row.

#include "abbe/calib/otf/judge.hpp"

namespace abbe::calib::otf {

struct Identification {
  Observations observations;
  Solution solution;
};
/// Pure and deterministic: the same input gives the same bits.
[[nodiscard]] Result<Identification> identify(std::span<const TrackerObservation>, const Machine&,
                                              const Path&, const Noise&, const Options& = {});

}  // namespace abbe::calib::otf
