#pragma once

#include <span>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

/// Part of the covariance of V that is caused by the misfit of the tables: the sum of m_T^2 g_T
/// g_T^T (misfit.hpp) over all tables T. m_T is linear between the nodes; beyond the end nodes it
/// is that of the nearest node.
[[nodiscard]] Matrix3 misfit_of_tables_m2(const Misfit&, const ParameterLayout&,
                                          const Vector3& axis_position_m,
                                          const Vector3& tool_offset_m);

/// Part of the variance of V (trace) that is caused by the misfit of the model: mean over the axis
/// positions, for the first tool offset.
[[nodiscard]] double mean_misfit_m2(const VolumetricModel&, std::span<const Vector3> places_m);

/// True if the misfit makes the rms standard uncertainty of V larger by 2 % or more over the volume
/// between the nodes. A smaller misfit has no practical effect. It can also be caused by the second
/// order of the exact transforms, if hundreds of legs repeat it.
[[nodiscard]] bool is_notable_misfit(const VolumetricModel&);

/// The larger value of each entry, because a run does not disprove the misfit that another run
/// shows. Null: no misfit. Both must belong to models with the same parameters.
[[nodiscard]] Misfit larger_misfit(const Misfit* a, const Misfit* b);

}  // namespace abbe::calib
