#pragma once
/// Orientation of a Multi-Feature Bar, determined from its signature: the shifts of some holes in
/// y. A rotation of the bar by 180 degrees about its axis x changes the sign of the signature;
/// about z its order and sign; about y its order.

#include <span>
#include <string_view>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::mfb {

enum class Orientation { Normal, TurnedAboutX, TurnedAboutY, TurnedAboutZ };

/// Text such as "as planned", "turned about x".
[[nodiscard]] std::string_view name(Orientation);

struct OrientationFit {
  Orientation orientation = Orientation::Normal;
  double rms_m = 0.0;  ///< rms of y of the points minus the signature in this orientation
  double runner_up_rms_m = 0.0;
};

/// Finds the orientation. `O_bar_m`: points of interest in the bar frame that follows from the
/// touches, whichever way the bar lies; `signature_m`: nominal y of each hole. Both are 0 at both
/// ends. BadInput: the sizes differ, or an end of the signature is not 0. NotApplicable: the
/// signature is the same in two orientations, or the second best orientation is not at least 5
/// times worse than the best (no signature, another bar, or errors as large as the signature); the
/// text states both values.
[[nodiscard]] Result<OrientationFit> orientation_of(std::span<const Vector3> O_bar_m,
                                                    std::span<const double> signature_m);

}  // namespace abbe::calib::mfb
