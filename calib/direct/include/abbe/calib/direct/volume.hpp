#pragma once
/// Compares directly measured error motions with a model in the volume, as in [Sanders 2023]
/// section 2.3.2: both become models of the same tables on the same nodes, in the convention of
/// datum G2 over the common range, and their V are compared on a grid.
///
/// - Tables: those that were measured and that the model has. Other tables are left out of both
///   models, and so is a squareness that was not measured. The comparison does not contain their
///   effect.
/// - Nodes of an axis: all measured positions from the largest first to the smallest last position
///   of its tables, within the nodes of the model. The measured tables are linear between their
///   positions; the model is taken at the nodes.
/// - A translation measured on a known line (MeasuredError::line_m) is converted to the table with
///   the measured rotations of the same axis; rotations that were not measured count as zero in
///   this conversion.
/// - A measured squareness is converted to the parameter with the measured rotations and
///   straightness, so that V has the measured slopes along its two lines.
/// - A run with one tool does not determine some rotations, so that the model does not have them.
///   Their effect is part of the translations of both models.
/// The uncertainty of the measured tables consists of DeviceUncertainty and of the scatter of the
/// runs, which is multiplied by the ratio of Student's t (for its degrees of freedom) to the normal
/// quantile. Pure.

#include <span>
#include <string>
#include <vector>

#include "abbe/calib/direct/compare.hpp"
#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::calib::direct {

/// A measured error that is not compared, with the reason.
struct LeftOut {
  std::string name, reason;
};

struct VolumeComparison {
  VolumetricModel measured, model;          ///< both on the same tables and nodes, for the tool of
                                            ///< the model
  std::vector<std::string> compared{};      ///< names of the errors that both have
  std::vector<std::string> not_measured{};  ///< names of errors of the model that were not measured
  std::vector<LeftOut> left_out{};          ///< measured, but not compared
  std::size_t points = 0;
  VectorStatistics V_measured{}, V_model{};
  ModelDifference difference{};  ///< measured minus model
  /// Root mean square over the grid of the stated standard uncertainty of the difference; nullopt
  /// if a table has one run and no uncertainty of the device is stated.
  std::optional<double> u_rms_m{};
};

/// Returns the errors of compare(), and DegenerateGeometry or TooFewObservations if the tables of
/// an axis have fewer than three common positions, if no error of the model was measured, or if the
/// grid has no volume inside the validity volume of the model.
[[nodiscard]] Result<VolumeComparison> compare_in_volume(std::span<const MeasuredError>,
                                                         const VolumetricModel&,
                                                         const DeviceUncertainty& = {});

}  // namespace abbe::calib::direct
