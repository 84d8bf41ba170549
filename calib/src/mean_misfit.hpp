#pragma once

#include <span>

#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib {

/// Mean over the axis positions of the variance of V (trace) that the misfit of the model causes,
/// for its first tool offset.
[[nodiscard]] double mean_misfit_m2(const VolumetricModel&, std::span<const Vector3> places_m);

/// True if the misfit makes u of V larger by 2 % or more, on average over the volume between the nodes.
/// A smaller one is of no use to anybody; it can be found where hundreds of legs repeat the second order
/// of the transforms.
[[nodiscard]] bool is_notable_misfit(const VolumetricModel&);

/// The larger value of each: neither of two runs shows that the misfit of the other is not there. Null:
/// no misfit. Both are of models with the same parameters.
[[nodiscard]] Misfit larger_misfit(const Misfit* a, const Misfit* b);

}  // namespace abbe::calib
