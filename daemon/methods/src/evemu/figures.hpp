#pragma once
/// The figures of an identification with a ball array that a model document contains, for the
/// report. Pure.

#include "abbe/methods/evemu/identification.hpp"
#include "abbe/model/run_figures.hpp"

namespace abbe::daemon {

/// Verdict, residuals at the balls by position, and places of the balls. Tables: the rotation that
/// touches do not determine, the array, the rotations of the positions, the choice of lambda and
/// gamma.
[[nodiscard]] RunFigures evemu_figures(const EvemuCandidate& candidate);

}  // namespace abbe::daemon
