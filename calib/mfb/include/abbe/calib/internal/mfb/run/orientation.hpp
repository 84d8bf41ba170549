#pragma once
/// Orientation of a Multi-Feature Bar, determined from its signature: some holes are shifted in y.
/// Turned about the bar axis x the signature changes its sign, turned about z its order and sign,
/// turned about y its order.

#include <span>
#include <string_view>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::mfb {

enum class Orientation { Normal, TurnedAboutX, TurnedAboutY, TurnedAboutZ };

/// "as planned", "turned about x", ...
[[nodiscard]] std::string_view name(Orientation);

struct OrientationFit {
  Orientation orientation = Orientation::Normal;
  double rms_m = 0.0;  ///< of y of the points against the signature in this orientation
  double runner_up_rms_m = 0.0;
};

/// `O_bar_m`: points of interest in the bar frame, which follows from the touches and not from the
/// way the bar lies; `signature_m`: nominal y of each hole, 0 at both ends, as y of the points is.
/// BadInput: the sizes differ, or an end of the signature is not 0. NotApplicable: the signature is
/// the same in two orientations, or the second best orientation is not at least 5 times worse than
/// the best (no signature, another bar, or errors of its size); the text states both values.
[[nodiscard]] Result<OrientationFit> orientation_of(std::span<const Vector3> O_bar_m,
                                                    std::span<const double> signature_m);

}  // namespace abbe::calib::mfb
