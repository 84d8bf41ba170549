#pragma once
/// The observations of a ball array as groups over any form of model
/// (estimation/observation_group.hpp), one group per position of the array. The pose of the array
/// at each position is a nuisance of its group without prior; errors of the array are unknowns that
/// all groups share (artefact_rows.hpp).
/// At position p, a_i: calibrated centre of ball i, r_i: its reading, T_p: pose of the array,
///     T_p a_i = r_i + D_i(V)
/// D_i(V): displacement of the fitted centre by V at the touched points (observe.hpp), or V(r_i)
/// if only errors were given. With an approximate pose T the observation is
///     y_i = T a_i - r_i = D_i(V) + t_p + theta_p x (r_i - r_1) + (errors of the array) + noise
/// T fits the array to the readings. theta_p is the small rotation between T and the true pose.
/// Terms of second order in it are neglected: theta^2 / 2 times the size of the array, 10 nm for
/// errors of 0.1 mm. With `V_at_m` T is fitted to corrected readings, and these terms vanish in the
/// iteration (Gauss-Newton).
///
/// The blocks of the array (its two faces) are not used as observations, because they are touched
/// with the same errors V; they only give an approximate pose. Because the poses are free, no rigid
/// motion of V is determined here.

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "abbe/calib/estimation/observation_group.hpp"
#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/calib/internal/evemu/solve/volumetric_design.hpp"

namespace abbe::calib::evemu {

struct PoseGroupOptions {
  /// Standard deviation of a ball centre per coordinate, must be positive. The slow noise is taken
  /// from Observations::slow_noise.
  double s_m = 1e-6;
  /// An estimate of V at a reading; empty: 0.
  std::function<Vector3(const Vector3& reading_m)> V_at_m{};
};

/// Returns one group per position, in the order of the positions. Unknowns: those of the design,
/// then one error of the array per column of artefact_rows(), each with standard deviation 1 (the
/// caller adds their prior). Errors: BadInput for an s that is not positive; those of fit_rigid().
[[nodiscard]] Result<std::vector<estimation::ObservationGroup>> pose_groups(
    const Observations&, const VolumetricDesign&, const PoseGroupOptions&);

}  // namespace abbe::calib::evemu
