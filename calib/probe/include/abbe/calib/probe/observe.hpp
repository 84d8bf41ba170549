#pragma once
/// Selects observations from recorded touches: touches of one place from one direction (for the
/// delay), and touches around a sphere (for the qualification). Pure; allocates. SI units.

#include <span>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"
#include "abbe/calib/probe/delay.hpp"
#include "abbe/calib/probe/qualification.hpp"

namespace abbe::calib::probe {

struct RecordedTouch {
  Vector3 p_m = Vector3::Zero();           ///< scale readings at contact
  Vector3 velocity_m_s = Vector3::Zero();  ///< velocity of the approach
};

struct SamePlaceOptions {
  double min_cosine = 0.999;       ///< approaches within 2.6 degrees count as one direction
  double max_sideways_m = 0.2e-3;  ///< largest distance across the approach within one place
};

/// The largest set of touches of one place from one direction, as speed and position along the mean
/// approach. Touches with zero velocity are not used.
[[nodiscard]] std::vector<FeedTouch> same_place(std::span<const RecordedTouch> touches,
                                                const SamePlaceOptions& options = {});

/// Returns each touch with the normal opposite to its approach. Touches with zero velocity are not
/// used.
[[nodiscard]] std::vector<QualifyingTouch> around_sphere(std::span<const RecordedTouch> touches);

}  // namespace abbe::calib::probe
