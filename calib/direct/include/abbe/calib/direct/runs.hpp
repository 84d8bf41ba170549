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

/// One measured value. `forward`: the axis moved towards larger positions.
struct Reading {
  double position_m = 0.0;  ///< 0 for squareness
  double value = 0.0;       ///< measured value in m or rad
  int run = 1;
  bool forward = true;
};

/// All values of one error motion or of one squareness error.
struct MeasuredError {
  std::string name;  ///< one of "EXX" to "ECZ", "EA0Z", "EB0Z", "EC0Y"
  std::vector<Reading> readings;
  /// Positions of the other two axes during the measurement, for which the functional point of the
  /// device has the tool offset of the model. The component of the moving axis has no effect. A
  /// rotation changes a translation by rotation times lever, and the lever depends on these
  /// positions. nullopt: the levers of the measured line are zero, so that the values are those of
  /// the tables. For a squareness: all three components of the point where its two lines meet;
  /// nullopt: the squareness is not compared.
  std::optional<Vector3> line_m{};
};

/// Two positions that differ by less than this are the same target: at a gradient of 100 um/m the
/// error changes by 1 nm over this distance.
inline constexpr double kSameTarget_m = 10e-6;

/// The runs of one error at the positions that all of them have.
struct Runs {
  std::vector<double> positions_m;      ///< positions of the common targets, ascending
  std::vector<Eigen::VectorXd> values;  ///< one vector per run: mean of the directions of the run
  /// One vector per run: forward minus backward ([ISO 230-2] reversal error). Empty if the runs
  /// have one direction only.
  std::vector<Eigen::VectorXd> reversal;
  std::size_t left_out = 0;  ///< number of positions that are missing in some run or direction

  /// Mean over the runs.
  [[nodiscard]] Eigen::VectorXd mean() const;
  /// Covariance of P * mean() from the scatter of the runs, [GUM] 4.2.3 and 5.2.3. P is applied to
  /// every run before the scatter is computed, so that what a convention removes is not scatter.
  /// Zero for one run.
  [[nodiscard]] Eigen::MatrixXd covariance_of_mean(const Eigen::MatrixXd& P) const;
};

/// Groups the readings by run. BadInput: no values, a position that occurs twice in one direction
/// of one run, runs of which only some have both directions, two runs with the same values at all
/// of three or more positions (a copy: their scatter would be zero). NotFinite: a value that is not
/// finite. TooFewObservations: no position is in all runs.
[[nodiscard]] Result<Runs> runs_of(const MeasuredError&);

/// Reversal error of a table: mean over its positions with its standard uncertainty, and the
/// largest value at one position. `u` comes from the scatter of the runs; nullopt for one run.
struct Reversal {
  double mean = 0.0;
  std::optional<double> u{};
  double largest = 0.0;  ///< largest mean over the runs at one position, with its sign
  double at_m = 0.0;     ///< the position of `largest`
};
/// Returns nullopt if the runs have one direction only.
[[nodiscard]] std::optional<Reversal> reversal_of(const Runs&);

}  // namespace abbe::calib::direct
