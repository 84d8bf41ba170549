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
/// Not estimable: differences between directions that the path does not show, for example of an
/// axis that moves in one direction only. The prior N(0, kUOfBacklash^2) of each b or D leaves
/// these at zero. With one value per table it does not change the model: b and a constant of the
/// table then occur only as their sum, and the gauge fixes the constants of all tables. With one
/// value per node U is uncertain by half the prior where the path shows one direction only.

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/estimation/information.hpp"
#include "abbe/calib/otf/observe.hpp"
#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib::otf {

/// Standard uncertainty of the prior of a difference between both directions, m or rad. Data with
/// an uncertainty of 1 um make a difference smaller by 1e-4 of its value because of the prior.
inline constexpr double kUOfBacklash = 100e-6;

/// Difference between both directions of travel: forward minus backward.
struct Backlash {
  ErrorMotion motion;
  std::optional<double> position_m{};  ///< of the node; absent for one value per table
  double value = 0.0;                  ///< m or rad
  double u = 0.0;                      ///< standard uncertainty; includes the variance factor
  bool determined = false;             ///< false: only the prior determines the value
};
/// "EXX", "EXX at -0.300 m"
[[nodiscard]] std::string label(const Backlash&);

/// The differences of a model in their order; empty without.
[[nodiscard]] std::vector<Backlash> backlash_of(const VolumetricModel&);

[[nodiscard]] bool estimates_backlash(const Observations&);
/// The first leg (standstill: position) on which the direction of travel of all axes is known.
/// RankDeficient if an axis does not move on the path.
[[nodiscard]] Result<std::size_t> first_with_known_travel(std::span<const AxisTravel>);
/// With backlash the legs before it are not used. "the legs before 2 are not used: Z had not moved
/// yet, ..."; empty if all are used.
[[nodiscard]] std::string note_on_unused(const Observations&);
/// The first leg that is used; adds note_on_unused() to the notes. 0 without backlash. The error of
/// first_with_known_travel().
[[nodiscard]] Result<std::size_t> first_with_backlash(Observations&);
/// `data` with the prior of all differences; unchanged without backlash.
[[nodiscard]] estimation::Information with_backlash_prior(estimation::Information data,
                                                          const Observations&);
/// In the order of the unknowns; empty without backlash. `U`, `covariance`: of all unknowns.
[[nodiscard]] std::vector<Backlash> backlash_of(const Observations&, const Eigen::VectorXd& U,
                                                const Eigen::MatrixXd& covariance);
/// The largest determined difference of each table, in the order of the tables.
[[nodiscard]] std::vector<Backlash> largest_of_tables(std::span<const Backlash>);
/// For the verdict: the tables with backlash beyond four standard uncertainties, each with its
/// largest difference, and the differences that are not determined.
[[nodiscard]] std::vector<std::string> notes_on(std::span<const Backlash>);
/// The model of an adjustment with the unknowns U: gauge G2, mean of both directions, with the
/// differences if they were estimated. `covariance`: of U. `tool_offsets_m`: of all runs.
[[nodiscard]] Result<VolumetricModel> model_of(const Observations&,
                                               std::span<const Vector3> tool_offsets_m,
                                               const Eigen::VectorXd& U,
                                               const Eigen::MatrixXd& covariance, ValidityVolume);

}  // namespace abbe::calib::otf
