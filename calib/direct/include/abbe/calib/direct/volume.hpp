#pragma once
/// Compares directly measured error motions with a model in the volume, as in [Sanders 2023]
/// section 2.3.2: both become models of the same tables on the same nodes, in the convention of
/// datum G2 over the common range, and their V are compared on a grid.
///
/// - Tables: those that were measured and that the model has. The others are left out of both, and
///   so is a squareness that was not measured: the comparison then does not contain their effect.
/// - Nodes of an axis: all measured positions from the largest first to the smallest last position
///   of its tables, within the nodes of the model. The measured tables are linear between their
///   positions; the model is taken at the nodes.
/// - A translation measured on a known line (MeasuredError::line_m) is converted to the table with
///   the measured rotations of the same axis; rotations that are not measured count as zero there.
/// - A measured squareness is converted to the parameter with the measured rotations and
///   straightness, so that V has the measured slopes along its two lines.
/// - The rotations that no run with one tool determines (the model does not have them) are part of
///   the translations of both.
/// Uncertainty of the measured tables: scatter of the runs times Student's t for its degrees of
/// freedom / the normal quantile, and DeviceUncertainty. Pure.

#include <span>
#include <string>
#include <vector>

#include "abbe/calib/direct/compare.hpp"
#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::calib::direct {

/// A measured error that is not compared.
struct LeftOut {
  std::string name, reason;
};

struct VolumeComparison {
  VolumetricModel measured, model;          ///< on the same tables and nodes, for the model's tool
  std::vector<std::string> compared{};      ///< errors in both
  std::vector<std::string> not_measured{};  ///< errors of the model that were not measured
  std::vector<LeftOut> left_out{};          ///< measured, but not compared
  std::size_t points = 0;
  VectorStatistics V_measured{}, V_model{};
  ModelDifference difference{};  ///< measured minus model
  /// Root mean square of the standard uncertainty of the difference as stated; nullopt if a table
  /// has one run and the device no stated uncertainty.
  std::optional<double> u_rms_m{};
};

/// Errors as those of compare(). DegenerateGeometry or TooFewObservations: the tables of an axis
/// have fewer than three common positions, no error was measured that the model has, or the grid
/// has no volume inside the validity volume of the model.
[[nodiscard]] Result<VolumeComparison> compare_in_volume(std::span<const MeasuredError>,
                                                         const VolumetricModel&,
                                                         const DeviceUncertainty& = {});

}  // namespace abbe::calib::direct
