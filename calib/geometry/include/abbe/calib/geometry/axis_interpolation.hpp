#pragma once
/// Interpolation of a function f(q) between its values U at the nodes x of an axis. Linear and
/// cubic interpolation are both linear in U and reproduce constants and straight lines exactly; the
/// datum conditions (model_datum.hpp) rely on these two properties. In the cell from x_k to x_k+1,
/// of length h:
///     u = (q - x_k) / h,  b = u,  a = 1 - u
///     linear:  f = a U_k + b U_k+1
///     cubic:   f = a U_k + b U_k+1 + ((a^3 - a) U''_k + (b^3 - b) U''_k+1) h^2 / 6,   U'' = M U
/// The cubic has continuous first and second derivatives ([Press 2007] section 3.3). Its matrix M
/// follows from the continuity of the first derivative at the inner nodes,
///     h_i-1 U''_i-1 + 2 (h_i-1 + h_i) U''_i + h_i U''_i+1
///         = 6 ((U_i+1 - U_i) / h_i - (U_i - U_i-1) / h_i-1),
/// and an end condition:
/// - natural: U'' = 0 at both ends,
/// - not-a-knot: the third derivative is continuous at the second and at the last but one node.
///   With three nodes the function is one parabola, with two nodes a straight line.
/// Outside the nodes, the formula of the nearest cell is extrapolated.

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "abbe/calib/base/error.hpp"

namespace abbe::calib {

enum class Interpolation { Linear, NaturalCubic, NotAKnotCubic };
/// Returns "linear", "cubic" (natural) or "not-a-knot-cubic".
[[nodiscard]] std::string_view name(Interpolation);
/// The interpolation of the tables of a model by its name(); nullopt for any other text.
[[nodiscard]] std::optional<Interpolation> table_interpolation(std::string_view name);

/// Weights of the nodes at one position. Points into the AxisInterpolation that returned it and
/// must not outlive that object.
class NodeWeights {
 public:
  [[nodiscard]] std::size_t first() const { return first_; }
  [[nodiscard]] std::size_t count() const { return count_; }
  /// Weight of node first() + i.
  [[nodiscard]] double operator[](std::size_t i) const {
    const double near = i == cell_ ? a_ : (i == cell_ + 1 ? b_ : 0.0);
    return below_ == nullptr ? near : near + curve_a_ * below_[i] + curve_b_ * above_[i];
  }

  /// The interpolation as a sum of four terms of the cell [k, k + 1], with the symbols of this
  /// header:
  ///     f = value[0] U_k + value[1] U_k+1 + curvature[0] U''_k + curvature[1] U''_k+1
  /// For linear interpolation `curvature` is zero.
  struct OfCell {
    std::size_t k = 0;
    double value[2] = {1.0, 0.0};
    double curvature[2] = {0.0, 0.0};
  };
  [[nodiscard]] OfCell of_cell() const { return {first_ + cell_, {a_, b_}, {curve_a_, curve_b_}}; }

 private:
  friend class AxisInterpolation;
  std::size_t first_ = 0, count_ = 2, cell_ = 0;  ///< cell_: counted from first_
  double a_ = 1.0, b_ = 0.0, curve_a_ = 0.0, curve_b_ = 0.0;
  const double *below_ = nullptr, *above_ = nullptr;  ///< rows k and k + 1 of M; null: linear
};

/// The interpolation of one axis: its nodes and, for a cubic, its matrix M. Immutable.
class AxisInterpolation {
 public:
  /// Largest number of nodes of a cubic. Its matrix M is dense: 500 x 500 numbers take 2 MB.
  static constexpr std::size_t kMostCubicNodes = 500;

  /// Returns BadInput or NotFinite for nodes that check_nodes() refuses, BadInput for a cubic with
  /// more than kMostCubicNodes nodes.
  [[nodiscard]] static Result<AxisInterpolation> of(std::span<const double> nodes_m, Interpolation);

  [[nodiscard]] Interpolation kind() const { return kind_; }
  [[nodiscard]] std::size_t size() const { return nodes_m_.size(); }
  /// Largest number of nodes that have a weight at one position.
  [[nodiscard]] std::size_t most_weights() const {
    return kind_ == Interpolation::Linear ? 2 : size();
  }

  /// Row of M for a node: the product of this row and U is U'' at the node. Empty for linear
  /// interpolation, whose U'' is zero.
  [[nodiscard]] std::span<const double> curvature_row(std::size_t node) const {
    return curvature_.empty() ? std::span<const double>{}
                              : std::span(curvature_).subspan(node * size(), size());
  }

  /// Weights of the nodes at a position. Does not allocate.
  [[nodiscard]] NodeWeights at(double position_m) const;

 private:
  std::vector<double> nodes_m_;
  Interpolation kind_ = Interpolation::Linear;
  std::vector<double> curvature_;  ///< the matrix M by rows; empty for linear interpolation
};

}  // namespace abbe::calib
