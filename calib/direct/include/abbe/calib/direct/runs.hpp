#pragma once
/// Error motions that a device measures directly, one after the other: a laser interferometer with
/// optics for straightness and angles, or a laser with six degrees of freedom. An error is measured
/// at the same positions in several runs, forward and backward. Values in m or rad, positions of
/// the moving axis (scale readings) in m; V = actual - nominal, tool relative to workpiece. Pure.

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/geometry/error_parameters.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::direct {

/// One value. `forward`: the axis moved towards larger positions.
struct Reading {
  double position_m = 0.0;  ///< 0 for squareness
  double value = 0.0;       ///< m or rad
  int run = 1;
  bool forward = true;
};

/// All values of one error motion or of one squareness error.
struct MeasuredError {
  std::string name;  ///< "EXX" to "ECZ", "EA0Z", "EB0Z", "EC0Y"
  std::vector<Reading> readings;
  /// Positions of the other two axes during the measurement, with the functional point of the
  /// device at the tool offset of the model; the component of the moving axis has no effect. A
  /// rotation changes the translations by rotation times lever, and the lever depends on these
  /// positions. nullopt: the levers of the measured line are zero, so that the values are those of
  /// the tables. Squareness: where its two lines meet, all three components; nullopt: it is not
  /// compared.
  std::optional<Vector3> line_m{};
};

/// Positions that differ by less are the same target: at a gradient of 100 um/m the error changes
/// by 1 nm.
inline constexpr double kSameTarget_m = 10e-6;

/// The runs of one error at the positions that all of them have.
struct Runs {
  std::vector<double> positions_m;      ///< ascending
  std::vector<Eigen::VectorXd> values;  ///< one per run: mean of its directions
  /// One per run: forward minus backward ([ISO 230-2] reversal error); empty if one direction only
  std::vector<Eigen::VectorXd> reversal;
  std::size_t left_out = 0;  ///< positions that some run or direction does not have

  /// Mean over the runs.
  [[nodiscard]] Eigen::VectorXd mean() const;
  /// Covariance of mean() from the scatter of the runs, [GUM] 4.2.3 and 5.2.3: of `P mean()`. The
  /// runs are reduced by P first: what a convention removes is not scatter. Zero for one run.
  [[nodiscard]] Eigen::MatrixXd covariance_of_mean(const Eigen::MatrixXd& P) const;
};

/// NotFinite; BadInput: no values, a position that occurs twice in one direction of one run, runs
/// of which only some have both directions, two runs with the same values at all of three or more
/// positions (a copy: their scatter would be zero). TooFewObservations: no position is in all runs.
[[nodiscard]] Result<Runs> runs_of(const MeasuredError&);

/// Reversal of a table: mean over its positions with its standard uncertainty, and the largest mean
/// of the runs at one position. u: from the scatter of the runs; nullopt for one run.
struct Reversal {
  double mean = 0.0;
  std::optional<double> u{};
  double largest = 0.0;  ///< of the mean over the runs, with its sign
  double at_m = 0.0;     ///< where it is largest
};
/// nullopt if the runs have one direction only.
[[nodiscard]] std::optional<Reversal> reversal_of(const Runs&);

}  // namespace abbe::calib::direct
