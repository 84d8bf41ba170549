#pragma once
/// Values of the standards for machine tools, computed from a model for a certificate. All values
/// follow from V (volumetric_model.hpp) of the functional point, for the first tool offset of the
/// model, along straight lines inside the validity volume. They do not change with a rigid motion
/// of the whole volume; they are therefore the same in every datum.
///
/// Uncertainty: each value f is a linear function of the parameters, f = a U, u^2 = a cov(U) a^T
/// ([GUM] 5.2.2 eq. (13)). A range max - min is the difference l of the values at the two positions
/// at which the estimate has its maximum and minimum. The true maximum and minimum may be
/// elsewhere. u therefore combines the variance of l with the effect of errors e on the range
/// beyond their effect on l. 256 errors e are drawn from cov(U), the same in every run and on every
/// processor:
///     u^2 = a cov(U) a^T + max(b^2, mean of (range(c y + e) - range(c y))^2 - (l e)^2)
/// y: the values; c: factor that reduces y to its size without noise; b: increase of the range by
/// noise, on average. The stated range is not corrected for b ([GUM] F.2.4.5). The largest |value|
/// is treated in the same way. A range that is not several times as large as its expanded
/// uncertainty is an upper limit, not an estimate. Noise also increases the mean and the rms of
/// |V|; they have no u. u does not contain the scatter of repeated approaches (a model has no
/// repetitions, so the A, R and s of ISO 230-2 cannot be computed), errors between the nodes beyond
/// the misfit of the model (misfit.hpp), and changes after the measurement.
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
  /// false: the value is 0 for all parameters of the model, so that the model does not determine
  /// it. Example: the straightness of an axis with two nodes.
  bool in_model = true;
};

/// The box in which the lines lie. It is the bounding box of the validity volume if its corners are
/// in the volume. Otherwise it is the largest smaller box of the same shape about the same centre
/// that is in the volume (about the mean of the vertices, if the centre is not in the volume).
struct LineBox {
  Vector3 low_m = Vector3::Zero(), high_m = Vector3::Zero();
  bool whole = true;  ///< true if this is the bounding box itself
  [[nodiscard]] Vector3 centre_m() const { return 0.5 * (low_m + high_m); }
};
/// Computes the box. DegenerateGeometry without a validity volume.
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
/// B and E are absent if the model has no differences between the directions. They are also absent
/// if a difference with an effect on this line is not determined (model/backlash.hpp), because the
/// axis moved in one direction only.
struct Positioning {
  Axis axis = Axis::X;
  std::vector<double> targets_m;
  std::vector<Value> mean;  ///< x_i minus x at the first target; u of this difference
  Value M;
  std::optional<Value> E, B, mean_B;  ///< mean_B: mean of all B_i
  /// Range of the linear positioning error (EXX) of ISO 230-1; it is the same as M.
  [[nodiscard]] const Value& range() const { return M; }
};

/// Straightness of the functional point on the line of Positioning: range of the component of V
/// after subtraction of the least-squares straight line over the travel ([ISO 230-1]). V is taken
/// as linear between the targets, so that a higher density of targets does not change the line.
struct Straightness {
  ErrorMotion motion;
  std::vector<Value> deviation;  ///< deviation from the reference line at the targets of the axis
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
/// these values. A model for one tool has no rotations that this tool cannot determine.
struct Angular {
  ErrorMotion motion;
  Value range;
};

/// Diagonal displacement [ISO 230-6]: component of V along a body diagonal of the box, relative to
/// its value at the beginning. The name gives the direction of travel along X, Y, Z: P positive, N
/// negative. M, E and B are those of the whole diagonal: they use all positions at which an axis is
/// at a node of the model, and the extremes between these positions (with linear tables V is a
/// parabola there, because rotations have levers).
struct Diagonal {
  std::string name;  ///< "PPP", "NPP", "PNP" or "NNP"
  Vector3 from_m = Vector3::Zero(), to_m = Vector3::Zero();
  std::vector<double> along_m;  ///< distances of the 21 positions of a plotted curve from the
                                ///< beginning
  std::vector<Value> mean;      ///< mean of both directions of travel, relative to the beginning
  Value M;                      ///< range of the mean
  /// Bidirectional systematic deviation: range over both directions. E and B are absent without
  /// backlash in the model, and if the path does not determine the backlash of each axis.
  std::optional<Value> E;
  std::optional<Value> B;  ///< reversal error with the largest absolute value, with its sign
};

struct StandardValues {
  LineBox box;
  Vector3 tool_offset_m = Vector3::Zero();
  std::array<Positioning, 3> positioning;
  std::vector<Straightness> straightness;  ///< EYX EZX EXY EZY EXZ EYZ
  std::array<Squareness, 3> squareness;    ///< EC0Y EB0Z EA0Z
  std::vector<Angular> angular;            ///< EAX .. ECZ, as far as the model has them
  std::array<Diagonal, 4> diagonals;
  [[nodiscard]] const Diagonal& diagonal_of_largest_M() const;
  /// The E of this diagonal is E_d, the diagonal systematic deviation. nullptr without backlash.
  [[nodiscard]] const Diagonal* diagonal_of_largest_E() const;
};

/// Computes all values. DegenerateGeometry if the model has no validity volume.
[[nodiscard]] Result<StandardValues> standard_values(const VolumetricModel&);

/// |V| over a regular lattice of points of the box, in the datum of the model.
struct VolumeError {
  std::size_t points = 0;
  double mean_m = 0.0, rms_m = 0.0;  ///< |V| before compensation
  Value largest;  ///< the largest |V|; its u contains u of V in this direction and the mean
                  ///< increase by noise
  /// Mean, rms and maximum of |V| after removal of the best-fit rigid motion of the lattice.
  double rigid_free_mean_m = 0.0, rigid_free_rms_m = 0.0, rigid_free_max_m = 0.0;
  /// Expanded uncertainty U(V) = 2 sqrt(trace cov V) for unknown directions of travel
  /// (volumetric_model.hpp). The |V| that remains after compensation is below it with a probability
  /// of 95 % (if one direction is uncertain) to 99 % (if all three are equally uncertain).
  double mean_U_m = 0.0, max_U_m = 0.0;
  /// U(V) after removal of the best-fit rigid motion of the lattice: the uncertainty of the shape
  /// of V alone.
  double rigid_free_mean_U_m = 0.0, rigid_free_max_U_m = 0.0;
};
[[nodiscard]] Result<VolumeError> volume_error(const VolumetricModel&);

}  // namespace abbe::calib::iso
