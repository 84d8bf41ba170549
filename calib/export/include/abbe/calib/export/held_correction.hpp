#pragma once
/// The part of a model's correction c that the compensation of a control can hold. c solves
///     c = -V(p + c),   p: commanded position, V = actual - nominal
/// A control with tables does not iterate. At p it adds
///     c_held(p) = sum_k effect_k(p) T_k(p_a)
/// T_k: table of one error motion of axis a, linear between nodes; effect_k: a unit vector for a
/// translation, its cross product with the lever for a rotation (rigid_body_model.hpp). The tables
/// hold corrections: T = -error. All functions are pure.

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/model/interpolation_grid.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

/// An axis-aligned part of the machine's volume; scale readings.
struct ExportBox {
  Vector3 min_m = Vector3::Zero(), max_m = Vector3::Zero();
};

/// Returns `part`, or the box around the validity hull if `part` is not given. BadInput if `part`
/// is given and is empty or reaches more than ValidityVolume::kTolerance_m beyond this box: a model
/// is not extrapolated into a control.
[[nodiscard]] Result<ExportBox> export_box(const VolumetricModel&,
                                           const std::optional<ExportBox>& part = {});

struct NodeOptions {
  std::optional<double> step_m{};  ///< largest distance of nodes; if not given: see export_nodes()
  bool equidistant = false;        ///< true if the format of the control has a constant step
};

/// Nodes of each axis, from one end of the box to the other.
/// - With `step_m`: equal steps of at most this length.
/// - Linear tables: their nodes inside the box, and its ends. With `equidistant`, equal steps of at
///   most the smallest distance of these nodes.
/// - Cubic tables and polynomials: 32 equal steps.
/// BadInput if the step is not positive, or gives more than kMostExportNodes on an axis.
inline constexpr std::size_t kMostExportNodes = 5000;
[[nodiscard]] Result<GridAxes> export_nodes(const VolumetricModel&, const ExportBox&,
                                            const NodeOptions&);

struct HeldTable {
  ErrorMotion motion;
  std::vector<double> value;         ///< m or rad at the nodes; mean of both directions of travel
  std::vector<double> half_forward;  ///< value for forward travel minus `value`; empty: no
                                     ///< difference
};

/// The tables of a control. A position beyond the end nodes has the value of the nearest end node.
struct HeldTables {
  KinematicChain chain;
  Vector3 tool_offset_m = Vector3::Zero();
  GridAxes nodes_m;
  std::vector<HeldTable> tables;
  [[nodiscard]] Vector3 c_m(const Vector3& commanded_m, const AxisTravel& = {}) const;
};

/// Corrections at the nodes of a grid, linear in x, y and z between them; z varies fastest.
struct HeldGrid {
  GridAxes axes_m;
  std::vector<Vector3> c_node_m;
  std::vector<bool> inside;  ///< true if the node is in the validity volume
  [[nodiscard]] Vector3 c_m(const Vector3& commanded_m) const;
};

/// Fits tables of the given motions so that their correction differs least from c, in the
/// least-squares sense over the nodes inside the validity volume. A fit uses at most
/// kMostFittedNodes nodes per axis; tables with more nodes are interpolated between these.
/// `per_direction`: also fit the difference between the directions of travel of the table's own
/// axis. Translations across the axis and rotations are zero at the node nearest to the reference
/// of the axis, because the tables of the other axes contain their constant part.
/// TooFewObservations without a node inside the validity volume; errors as
/// VolumetricModel::command_correction().
inline constexpr std::size_t kMostFittedNodes = 64;
[[nodiscard]] Result<HeldTables> fit_tables(const VolumetricModel&, const Vector3& tool_offset_m,
                                            std::span<const ErrorMotion>, const GridAxes& nodes_m,
                                            bool per_direction);

/// The tables of the model itself, with opposite sign. Squareness is contained as a slope in the
/// straightness tables EXY, EXZ and EYZ, because controls define squareness in different ways. A
/// model of polynomials has no tables: fit_tables() is called with the motions that one tool
/// determines. The difference between -V(p), which a control computes from these tables, and c is
/// of second order.
[[nodiscard]] Result<HeldTables> tables_of_model(const VolumetricModel&,
                                                 const Vector3& tool_offset_m,
                                                 const GridAxes& nodes_m);

/// Corrections c at the nodes of a grid, for one direction of travel.
[[nodiscard]] Result<HeldGrid> grid_of_model(const VolumetricModel&, const Vector3& tool_offset_m,
                                             const GridAxes& nodes_m, const AxisTravel&);

/// positioning_motions(): EXX EYY EZZ. translation_motions(): these and the six straightness
/// errors.
[[nodiscard]] std::vector<ErrorMotion> positioning_motions();
[[nodiscard]] std::vector<ErrorMotion> translation_motions();

/// A commanded position and direction of travel at which an exported file is compared with the
/// model.
struct ExportPlace {
  Vector3 commanded_m = Vector3::Zero();
  AxisTravel travel{};  ///< forward or backward for each axis
};
/// Returns places that are uniformly distributed in the box and inside the validity volume. The
/// same seed gives the same places. DegenerateGeometry if less than 1 of 1000 places of the box is
/// inside.
[[nodiscard]] Result<std::vector<ExportPlace>> random_places(const VolumetricModel&,
                                                             const ExportBox&, std::size_t count,
                                                             std::uint32_t seed);

using CorrectionFunction = std::function<Vector3(const ExportPlace&)>;

/// Statistics over the places, separately for x, y and z.
struct ExportLoss {
  /// of c: error without correction
  Vector3 rms_without_m = Vector3::Zero(), max_without_m = Vector3::Zero();
  /// of c - c_held: part that is lost
  Vector3 rms_lost_m = Vector3::Zero(), max_lost_m = Vector3::Zero();
};
/// Compares `held` with c at the places. If `travel` is not given, the direction of each place is
/// used.
[[nodiscard]] Result<ExportLoss> export_loss(const VolumetricModel&, const Vector3& tool_offset_m,
                                             std::span<const ExportPlace>,
                                             const std::optional<AxisTravel>& travel,
                                             const CorrectionFunction& held);

/// Effect of one error of the model on V in the volume, and the part of it that tables of the given
/// motions cannot hold.
struct ErrorLoss {
  std::string name;  ///< such as "EAX", "EC0Y"
  double rms_m = 0.0, rms_lost_m = 0.0, max_lost_m = 0.0;
};
/// Returns one entry for each error that has an effect. Empty for a model of polynomials, because
/// it does not separate the errors. The loss by linear interpolation between nodes is not included.
[[nodiscard]] Result<std::vector<ErrorLoss>> losses_by_error(const VolumetricModel&,
                                                             const Vector3& tool_offset_m,
                                                             std::span<const ErrorMotion>,
                                                             const ExportBox&);

}  // namespace abbe::calib
