#pragma once
/// Values of the standards for machine tools, computed from a model: what a certificate states.
/// All values follow from V (volumetric_model.hpp) of the functional point, for the first tool
/// offset of the model, along straight lines inside the validity volume. They do not change with a
/// rigid motion of the whole volume; they are therefore the same in every datum.
///
/// Uncertainty: each value f is a linear function of the parameters, f = a U, u^2 = a cov(U) a^T
/// ([GUM] 5.2.2 eq. (13)). A range max - min is the difference l at the two positions at which it
/// occurs in the estimate; the largest and the smallest of the true values may be elsewhere. So its
/// u is that of l and the mean square of what 256 errors e drawn from cov(U) (the same in every
/// run, on every processor) change in the range beyond l:
///     u^2 = a cov(U) a^T + max(b^2, mean of (range(c y + e) - range(c y))^2 - (l e)^2)
/// y: the values, c: the factor that removes from their size what noise adds to it, b: by how much
/// noise makes a range larger than the true one on average; the value is not corrected for it
/// ([GUM] F.2.4.5). The same for a largest |value|. A range that is not several times as large as
/// its U is an upper limit, not an estimate. The mean and the rms of |V| are raised likewise; they
/// have no u. Not contained: the scatter of repeated approaches (a model has no repetitions, so the
/// A, R and s of ISO 230-2 cannot be computed), errors between the nodes beyond the misfit of the
/// model (misfit.hpp), and changes after the measurement.
///
/// Pure; any thread. Lengths in m, angles in rad, u: standard uncertainty (k = 1).

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib::iso {

struct Value {
  double value = 0.0;
  double u = 0.0;
  /// false: the value is 0 for all parameters of the model, for example the straightness of an axis
  /// with two nodes. It is not known then.
  bool in_model = true;
};

/// The box inside the validity volume in which the lines are: the bounding box of the volume, or,
/// if its corners are not in the volume, the largest smaller box of the same shape about its centre
/// (about the mean of the vertices, if the centre is not in the volume).
struct LineBox {
  Vector3 low_m = Vector3::Zero(), high_m = Vector3::Zero();
  bool whole = true;  ///< the corners of the bounding box are in the validity volume
  [[nodiscard]] Vector3 centre_m() const { return 0.5 * (low_m + high_m); }
};
/// DegenerateGeometry without a validity volume.
[[nodiscard]] Result<LineBox> line_box(const ValidityVolume&);

/// Positioning along one axis on the line through the centre of the box ([ISO 230-2]; terms there
/// refer to mean deviations x_i of repeated approaches; here x_i is the component of V along the
/// axis). Targets p_i: the nodes of the model inside the box and its ends, at least 5, and at least
/// 5 per metre; at least 41 if the model is curved between its nodes.
///     x_i up, x_i down: V for approaches forward and backward;  x_i: their mean;
///     B_i = x_i up - x_i down
///     M = max x_i - min x_i                        mean bidirectional positional deviation
///     B = the B_i with the largest |B_i|           reversal error, with its sign
///     E = max(x_i up, x_i down) - min(x_i up, x_i down)   bidirectional systematic deviation
/// B and E are absent without differences between the directions in the model, and if the path does
/// not determine one that has an effect here (model/backlash.hpp), because the axis moved one way
/// only.
struct Positioning {
  Axis axis = Axis::X;
  std::vector<double> targets_m;
  std::vector<Value> mean;  ///< x_i relative to that at the first target; u of the difference
  Value M;
  std::optional<Value> E, B, mean_B;  ///< mean_B: mean of all B_i
  /// ISO 230-1: range of the linear positioning error (EXX), the same as M.
  [[nodiscard]] const Value& range() const { return M; }
};

/// Straightness of the functional point on the line of Positioning: range of the component of V
/// after subtraction of the least-squares straight line over the travel ([ISO 230-1]), V being
/// taken as linear between the targets, so that the line does not depend on where the targets are
/// dense.
struct Straightness {
  ErrorMotion motion;
  std::vector<Value> deviation;  ///< from the reference line, at the targets of the axis
  Value range;
};

/// Angle between the least-squares lines of two axes minus 90 degrees, as rotation of `axis`
/// relative to `reference` about the third direction. With the slopes s of V on the two lines:
///     EC0Y = -s_y(V_x) - s_x(V_y)     Y relative to X
///     EB0Z = +s_z(V_x) + s_x(V_z)     Z relative to X
///     EA0Z = -s_z(V_y) - s_y(V_z)     Z relative to Y
/// In datum G2 the squareness parameters of a model refer to the lines between the end points of
/// the straightness tables; they differ from these values by the slopes of these tables.
struct Squareness {
  std::string name;
  Axis axis = Axis::Y, reference = Axis::X;
  Value angle;
};

/// Range of one angular error over the box: max - min of its table. Only models with tables have
/// them; those of a model with one tool have no rotations that this tool does not show.
struct Angular {
  ErrorMotion motion;
  Value range;
};

/// Diagonal displacement [ISO 230-6]: component of V along a body diagonal of the box, relative to
/// its beginning. Name: direction of travel along X, Y, Z, P positive, N negative.
/// M, E and B are those of the whole diagonal: of all positions at which an axis is at a node of
/// the model, and of the extremes between them (with linear tables those of parabolas, since
/// rotations have levers).
struct Diagonal {
  std::string name;  ///< "PPP", "NPP", "PNP" or "NNP"
  Vector3 from_m = Vector3::Zero(), to_m = Vector3::Zero();
  std::vector<double> along_m;  ///< distance from the beginning: 21 positions, for curves
  std::vector<Value> mean;      ///< mean of both directions of travel, relative to the beginning
  Value M;                      ///< range of the mean
  /// Bidirectional systematic deviation: range over both directions. Absent, as B, without backlash
  /// and if the path does not determine that of each axis.
  std::optional<Value> E;
  std::optional<Value> B;  ///< reversal error of the largest size, with its sign
};

struct StandardValues {
  LineBox box;
  Vector3 tool_offset_m = Vector3::Zero();
  std::array<Positioning, 3> positioning;
  std::vector<Straightness> straightness;  ///< EYX EZX EXY EZY EXZ EYZ
  std::array<Squareness, 3> squareness;    ///< EC0Y EB0Z EA0Z
  std::vector<Angular> angular;            ///< EAX .. ECZ, those in the model
  std::array<Diagonal, 4> diagonals;
  [[nodiscard]] const Diagonal& diagonal_of_largest_M() const;
  /// Its E is E_d, the diagonal systematic deviation. nullptr without backlash.
  [[nodiscard]] const Diagonal* diagonal_of_largest_E() const;
};

/// DegenerateGeometry if the model has no validity volume.
[[nodiscard]] Result<StandardValues> standard_values(const VolumetricModel&);

/// |V| over a regular lattice of points of the box, in the datum of the model.
struct VolumeError {
  std::size_t points = 0;
  double mean_m = 0.0, rms_m = 0.0;  ///< |V| before compensation
  Value largest;  ///< the largest |V|; u of V in its direction, and what noise adds on average
  /// The same without the rigid motion that fits best to the lattice.
  double rigid_free_mean_m = 0.0, rigid_free_rms_m = 0.0, rigid_free_max_m = 0.0;
  /// U(V) = 2 sqrt(trace cov V), directions of travel unknown (volumetric_model.hpp). |V| that is
  /// left after compensation is below it with a probability of 95 % (one uncertain direction) to 99
  /// % (three alike).
  double mean_U_m = 0.0, max_U_m = 0.0;
  /// U(V) without the rigid motion that fits best to the lattice: of the shape of V alone.
  double rigid_free_mean_U_m = 0.0, rigid_free_max_U_m = 0.0;
};
[[nodiscard]] Result<VolumeError> volume_error(const VolumetricModel&);

}  // namespace abbe::calib::iso
