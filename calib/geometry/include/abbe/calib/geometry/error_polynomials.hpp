#pragma once
/// The 18 position-dependent errors of three linear axes as polynomials, and their effect on the
/// functional point. [Li OMM] eq. (3): every error function is
///     sum_k K_k q^k,    k = 0 .. order,   q: reading of the axis, K_k: coefficients.
/// With the 3 squareness errors the volumetric error is E = A(x, y, z) K. The axes are a1, a2, a3
/// from the workpiece to the tool. The error of an axis acts after the axis's own motion. To first
/// order
///     E = sum_i ( d_i(q_i) + e_i(q_i) x r_i ) + squareness,
///     d_i, e_i: translation and rotation error of axis i,
///     r_i = travels of the axes nearer to the tool + tool offset,
/// with one squareness rotation about the direction of a3 before the travel of a2, and two, about
/// the directions of a1 and a2, before the travel of a3. E = true - reading, evaluated at the
/// reading. Lengths in mm: the units of the coefficients are mm^(1-k) and rad mm^-k.

#include <Eigen/Core>
#include <array>
#include <compare>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/geometry/kinematic_chain.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

inline constexpr int kLeastOrder = 1;
inline constexpr int kMostOrder = 5;

/// The monomial x^i y^j z^k, exponents (i, j, k).
struct Monomial {
  std::array<int, 3> exponent{};
  [[nodiscard]] double at(const Vector3& p_mm) const;
  // A defaulted <=> compares with a literal 0, which clang-tidy 14 wrongly reports as a null
  // pointer.
  friend auto operator<=>(const Monomial&,
                          const Monomial&) = default;  // NOLINT(modernize-use-nullptr)
};

/// One term of A: the entry (component, coefficient) contains factor * monomial.
struct PolynomialTerm {
  std::size_t component = 0;
  std::size_t coefficient = 0;
  Monomial monomial;
  double factor = 1.0;
};

/// The matrix A in symbolic form. Immutable.
class ErrorPolynomials {
 public:
  /// Returns BadInput unless kLeastOrder <= order <= kMostOrder.
  [[nodiscard]] static Result<ErrorPolynomials> of(const KinematicChain&, int order,
                                                   const Vector3& tool_offset_mm = Vector3::Zero());

  /// Names of K: for axis x, y, z, for d (translation) then e (rotation), for direction x, y, z,
  /// order high to low: `k_exz2` = rotation about x, caused by the motion of z, coefficient of z^2.
  /// Then squareness: `S_zx`.
  [[nodiscard]] std::span<const std::string> names() const { return names_; }
  [[nodiscard]] std::span<const PolynomialTerm> terms() const { return terms_; }
  /// The matrix A (3 x names().size()) at the reading p.
  [[nodiscard]] Eigen::Matrix3Xd A(const Vector3& p_mm) const;

 private:
  std::vector<std::string> names_;
  std::vector<PolynomialTerm> terms_;
};

}  // namespace abbe::calib
