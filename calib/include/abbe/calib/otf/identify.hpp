#pragma once
/// observe and solve in a row; judge asks for the active model and the limits and follows by
/// itself.

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
