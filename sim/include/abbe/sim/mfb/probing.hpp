#pragma once
/// A machine with errors probes a Multi-Feature Bar: the scale readings of every touch. The reading
/// q of a touch solves p(q) = place of the tip (TruthMachine, exact transforms), to 1e-14 m.
///
/// place of the tip = pose ( contact + growth + sag + shape ) + drift - pre-travel * normal
///
/// contact: centre of the tip that touches the true surface on the line of the target; the part
/// program is aligned to the bar, so these lines are in the frame of the bar. pose: as planned,
/// plus the scatter of the clamping, by a rotation about the middle of the bar. The tip does not
/// bend. Pure; deterministic from the seed: a touch has the same noise in any plan with the same
/// order.

#include <span>
#include <vector>

#include "abbe/sim/mfb/probing_options.hpp"
#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim::mfb {

struct Touch {
  std::size_t measurement = 0;
  Target target;
  Eigen::Vector3d reading_m = Eigen::Vector3d::Zero();
  /// normal of the surface towards the tip, in machine axes
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

struct ProbedBar {
  std::vector<Touch> touches;         ///< in the order in which they were made
  std::vector<double> temperature_C;  ///< stated temperature of each measurement
};

/// BadInput: a name in `turned`, `wrong_m` or `missed` is not in the plan, or the tip does not fit
/// into the holes.
[[nodiscard]] Result<ProbedBar> probe_bar(const TruthMachine& machine, const TrueBar& bar,
                                          std::span<const Measurement> plan,
                                          const ProbingOptions& options);

}  // namespace abbe::sim::mfb
