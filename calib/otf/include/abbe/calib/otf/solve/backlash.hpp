#pragma once
/// Backlash of the error tables as additional unknowns (Options::backlash). With the direction of
/// travel s of an axis (travel.hpp) the value of each of its tables at position q is
///     U(q) + s b / 2    or    U(q) + s D(q) / 2,    s = 1 forward, -1 backward
/// b: one value per table (TravelDependence::Backlash), D: one value per node (Tables). U is the
/// mean of both directions. The VolumetricModel has the differences with their covariance
/// (TravelDifferences): V for a direction of travel contains them, and the covariance of the mean
/// contains half of them.
///
/// Legs, or positions of standstills, before the first motion of an axis are not used: s of this
/// axis is not known there.
///
/// Not estimable: differences between directions of an axis that moves in one direction only. The
/// prior N(0, kUOfBacklash^2) of each b or D leaves these at zero. With one value per table the
/// prior then does not change the model: b and a constant of the table occur only as a sum, and the
/// datum fixes the constants of all tables. With one value per node, U has the additional
/// uncertainty of half the prior at nodes that were passed in one direction only.

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/estimation/information.hpp"
#include "abbe/calib/model/backlash.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/calib/otf/observe/known_travel.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// Returns `data` with the prior of all differences added; unchanged without backlash.
[[nodiscard]] estimation::Information with_backlash_prior(estimation::Information data,
                                                          const Observations&);
/// The differences in the order of the unknowns; empty without backlash. `U`, `covariance`: for all
/// unknowns.
[[nodiscard]] std::vector<Backlash> backlash_of(const Observations&, const Eigen::VectorXd& U,
                                                const Eigen::MatrixXd& covariance);
/// Makes the model from the unknowns U of an adjustment: datum G2, mean of both directions, with
/// the differences if they were estimated. `covariance`: that of U. `tool_offsets_m`: those of all
/// runs.
[[nodiscard]] Result<VolumetricModel> model_of(const Observations&,
                                               std::span<const Vector3> tool_offsets_m,
                                               const Eigen::VectorXd& U,
                                               const Eigen::MatrixXd& covariance, ValidityVolume);

}  // namespace abbe::calib::otf
