#pragma once
/// The design used for all numerical work: its functions span the same space as the columns of the
/// equivalent model (equivalent_model.hpp), but are Legendre polynomials of u = (q - centre) / half
/// width, q: reading. The arm with which a rotation acts is in units of the largest half width.
/// Every function is at most about 1 in the volume, so every coefficient is a length: the size of
/// its contribution to V. Penalties and priors refer to these coefficients. A stylus offset does
/// not change the space and is therefore not a parameter of the design.

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/geometry/equivalent_model.hpp"

namespace abbe::calib {

/// The box of scale readings to which a design is scaled.
struct ReadingBox {
  Vector3 centre_m = Vector3::Zero();
  Vector3 half_width_m = Vector3::Ones();
};
/// Bounding box of the points.
[[nodiscard]] ReadingBox bounding_box(std::span<const Vector3> readings_m);

enum class FunctionKind { Constant, Translation, Rotation };

/// A vector function of the readings: the sum of its parts. Each part is in one component of V,
///     sign * P_order(u_axis)   or   sign * P_order(u_axis) * arm,
/// P_order: Legendre polynomial, u_axis: scaled reading of the axis, arm: scaled reading of another
/// axis in units of arm_unit_m().
struct DesignFunction {
  struct Part {
    std::size_t component = 0;
    double sign = 1.0;
    std::size_t arm = 3;  ///< axis of the arm; 3: no arm
  };
  FunctionKind kind = FunctionKind::Constant;
  std::size_t axis = 0;
  int order = 0;
  std::array<Part, 2> part{};
  std::size_t parts = 1;
};

/// The functions of the scaled design for one kinematic chain, order and box. Immutable.
class ScaledDesign {
 public:
  /// Values of all Legendre polynomials and arms at one reading.
  struct Factors {
    std::array<std::array<double, kMostOrder + 1>, 3> P;
    std::array<double, 4> arm;  ///< of X, Y, Z; the last is 1: no arm
  };

  /// Returns DegenerateGeometry if the box has no extent in an axis, BadInput for an order outside
  /// kLeastOrder to kMostOrder.
  [[nodiscard]] static Result<ScaledDesign> of(const KinematicChain&, int order, const ReadingBox&);

  [[nodiscard]] const EquivalentModel& equivalent() const { return equivalent_; }
  [[nodiscard]] const ReadingBox& box() const { return box_; }
  /// Unit of the arms: the largest half width.
  [[nodiscard]] double arm_unit_m() const { return box_.half_width_m.maxCoeff(); }
  [[nodiscard]] std::size_t size() const { return functions_.size(); }
  /// The functions in the order of equivalent().names(). Function j contributes to the named
  /// coefficient j and, because a Legendre polynomial contains lower powers, to other named
  /// coefficients.
  [[nodiscard]] std::span<const DesignFunction> functions() const { return functions_; }

  [[nodiscard]] Factors factors(const Vector3& reading_m) const;
  [[nodiscard]] static double value(const DesignFunction& f, const DesignFunction::Part& part,
                                    const Factors& at) {
    return part.sign * at.P[f.axis][static_cast<std::size_t>(f.order)] * at.arm[part.arm];
  }
  /// Matrix B (3 x size()) at a reading: E_m = B c_m, c_m: coefficients in m.
  [[nodiscard]] Eigen::Matrix3Xd B(const Vector3& reading_m) const;
  /// Matrix M that converts the coefficients c_m of this design to those of the equivalent model:
  /// beta = M (1000 c_m). The units of beta are mm^(1-k) and rad mm^-k for order k.
  [[nodiscard]] Eigen::MatrixXd named_from_scaled() const;
  /// Matrix (size() x 3) that maps a small rotation vector omega to the coefficients c of the field
  /// V(q) = omega x (q - about).
  [[nodiscard]] Eigen::MatrixX3d rotation_about(const Vector3& about_m) const;

 private:
  EquivalentModel equivalent_;
  ReadingBox box_;
  std::vector<DesignFunction> functions_;
};

}  // namespace abbe::calib
