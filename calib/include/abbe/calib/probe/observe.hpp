#pragma once
/// Recorded touches as observations: which of them met one place from one side (for the delay),
/// which went around a sphere (for the qualification). Pure; allocates. SI.

#include <span>
#include <vector>

#include "abbe/calib/geometry.hpp"
#include "abbe/calib/probe/delay.hpp"
#include "abbe/calib/probe/qualification.hpp"

namespace abbe::calib::probe {

struct RecordedTouch {
  Vector3 p_m = Vector3::Zero();           ///< scales at contact
  Vector3 velocity_m_s = Vector3::Zero();  ///< of the approach
};

struct SamePlaceOptions {
  double min_cosine = 0.999;       ///< between approaches from one side: 2.6 degrees
  double max_sideways_m = 0.2e-3;  ///< between places, across the approach
};

/// The largest set of touches that meet one place from one side, as speed and place along the mean
/// approach. Touches that stand still are left out.
[[nodiscard]] std::vector<FeedTouch> same_place(std::span<const RecordedTouch> touches,
                                                const SamePlaceOptions& options = {});

/// Each touch with the normal against its approach.
[[nodiscard]] std::vector<QualifyingTouch> around_sphere(std::span<const RecordedTouch> touches);

}  // namespace abbe::calib::probe
