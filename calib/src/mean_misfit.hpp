#pragma once

#include <span>

#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib {

/// Mean over the axis positions of the variance of V (trace) that the misfit of the model causes,
/// for its first tool offset.
[[nodiscard]] double mean_misfit_m2(const VolumetricModel&, std::span<const Vector3> places_m);

}  // namespace abbe::calib
