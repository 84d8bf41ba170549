#pragma once

#include <span>

#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib {

/// Mean over the axis positions of the variance of V (trace) that the misfit of the model causes,
/// for its first tool offset.
[[nodiscard]] double mean_misfit_m2(const VolumetricModel&, std::span<const Vector3> places_m);

/// The larger value of each: neither of two runs shows that the misfit of the other is not there. Null:
/// no misfit. Both are of models with the same parameters.
[[nodiscard]] Misfit larger_misfit(const Misfit* a, const Misfit* b);

}  // namespace abbe::calib
