#pragma once

#include <span>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

/// Covariance of V that the misfit of the tables causes: sum of m_T^2 g_T g_T^T (misfit.hpp). m_T
/// is linear between the nodes; beyond them it is that of the nearest node.
[[nodiscard]] Matrix3 misfit_of_tables_m2(const Misfit&, const ParameterLayout&,
                                          const Vector3& axis_position_m,
                                          const Vector3& tool_offset_m);

/// Mean over the axis positions of the variance of V (trace) that the misfit of the model causes,
/// for its first tool offset.
[[nodiscard]] double mean_misfit_m2(const VolumetricModel&, std::span<const Vector3> places_m);

/// True if the misfit makes u of V larger by 2 % or more, on average over the volume between the
/// nodes. A smaller one is of no use to anybody; it can be found where hundreds of legs repeat the
/// second order of the transforms.
[[nodiscard]] bool is_notable_misfit(const VolumetricModel&);

/// The larger value of each: neither of two runs shows that the misfit of the other is not there.
/// Null:
/// no misfit. Both are of models with the same parameters.
[[nodiscard]] Misfit larger_misfit(const Misfit* a, const Misfit* b);

}  // namespace abbe::calib
