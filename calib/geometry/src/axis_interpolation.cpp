#include "abbe/calib/geometry/axis_interpolation.hpp"

#include <Eigen/Core>
#include <algorithm>

#include "abbe/calib/geometry/linear_interpolation.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib {
namespace {

/// Left side of equation i of the linear system for the second derivatives U'' at the nodes:
///     sub U''_i-1 + diagonal U''_i + super U''_i+1.
struct TridiagonalRow {
  double sub = 0.0, diagonal = 0.0, super = 0.0;
};

/// Equations of the inner nodes. U'' at the two end nodes is eliminated: the end condition
/// expresses it by U'' at inner nodes, which changes coefficients of the first and last equation.
std::vector<TridiagonalRow> inner_equations(std::span<const double> h_m, Interpolation kind) {
  std::vector<TridiagonalRow> rows;
  for (std::size_t i = 0; i + 1 < h_m.size(); ++i) {
    rows.push_back({h_m[i], 2.0 * (h_m[i] + h_m[i + 1]), h_m[i + 1]});
  }

  if (kind == Interpolation::NotAKnotCubic && rows.size() == 1) {  // U'' is the same everywhere
    rows[0].diagonal += rows[0].sub + rows[0].super;
  } else if (kind == Interpolation::NotAKnotCubic && !rows.empty()) {
    const double begin = h_m[0] / h_m[1], end = h_m[h_m.size() - 1] / h_m[h_m.size() - 2];
    rows.front().diagonal += rows.front().sub * (1.0 + begin);
    rows.front().super -= rows.front().sub * begin;
    rows.back().diagonal += rows.back().super * (1.0 + end);
    rows.back().sub -= rows.back().super * end;
  }

  return rows;
}

/// Solves the system in place, for one right-hand side per column. The matrix is diagonally
/// dominant, so that no pivoting is needed.
void solve_tridiagonal(std::vector<TridiagonalRow> rows, Eigen::Ref<Eigen::MatrixXd> x) {
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const double factor = rows[i].sub / rows[i - 1].diagonal;
    rows[i].diagonal -= factor * rows[i - 1].super;
    x.row(static_cast<Eigen::Index>(i)) -= factor * x.row(static_cast<Eigen::Index>(i - 1));
  }

  for (std::size_t i = rows.size(); i-- > 0;) {
    const auto at = static_cast<Eigen::Index>(i);
    if (i + 1 < rows.size()) {
      x.row(at) -= rows[i].super * x.row(at + 1);
    }
    x.row(at) /= rows[i].diagonal;
  }
}

/// Sets the rows of M for the two end nodes (U'' at both ends).
void set_ends(Eigen::MatrixXd& M, std::span<const double> h_m, Interpolation kind) {
  const Eigen::Index last = M.rows() - 1;
  if (kind != Interpolation::NotAKnotCubic || last < 2) {
    return;  // U'' is zero at both ends
  }

  if (last == 2) {
    M.row(0) = M.row(1);
    M.row(2) = M.row(1);
    return;
  }

  const double begin = h_m[0] / h_m[1], end = h_m[h_m.size() - 1] / h_m[h_m.size() - 2];
  M.row(0) = (1.0 + begin) * M.row(1) - begin * M.row(2);
  M.row(last) = (1.0 + end) * M.row(last - 1) - end * M.row(last - 2);
}

/// The matrix M (axis_interpolation.hpp), stored by rows.
std::vector<double> curvature_matrix(std::span<const double> nodes_m, Interpolation kind) {
  const auto n = static_cast<Eigen::Index>(nodes_m.size());
  std::vector<double> h_m;
  for (std::size_t i = 0; i + 1 < nodes_m.size(); ++i) {
    h_m.push_back(nodes_m[i + 1] - nodes_m[i]);
  }

  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 1; i + 1 < n; ++i) {
    const double before = 6.0 / h_m[static_cast<std::size_t>(i - 1)];
    const double after = 6.0 / h_m[static_cast<std::size_t>(i)];
    M(i, i - 1) = before;
    M(i, i) = -before - after;
    M(i, i + 1) = after;
  }

  if (n > 2) {
    solve_tridiagonal(inner_equations(h_m, kind), M.middleRows(1, n - 2));
  }
  set_ends(M, h_m, kind);

  std::vector<double> by_rows(static_cast<std::size_t>(M.size()));
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(by_rows.data(),
                                                                                     n, n) = M;
  return by_rows;
}

}  // namespace

std::string_view name(Interpolation kind) {
  switch (kind) {
    case Interpolation::Linear:
      break;
    case Interpolation::NaturalCubic:
      return kCubicBasis;
    case Interpolation::NotAKnotCubic:
      return kNotAKnotCubicBasis;
  }
  return kLinearBasis;
}

std::optional<Interpolation> table_interpolation(std::string_view text) {
  for (const Interpolation kind :
       {Interpolation::Linear, Interpolation::NaturalCubic, Interpolation::NotAKnotCubic}) {
    if (text == name(kind)) {
      return kind;
    }
  }
  return std::nullopt;
}

Result<AxisInterpolation> AxisInterpolation::of(std::span<const double> nodes_m,
                                                Interpolation kind) {
  ABBE_TRY(check_nodes(nodes_m));

  AxisInterpolation result;
  result.nodes_m_.assign(nodes_m.begin(), nodes_m.end());
  result.kind_ = kind;
  if (kind == Interpolation::Linear) {
    return result;
  }

  if (nodes_m.size() > kMostCubicNodes) {
    return failure(ErrorCode::BadInput, message("nodes of an axis: ", nodes_m.size(),
                                                ", a cubic has at most ", kMostCubicNodes));
  }

  result.curvature_ = curvature_matrix(nodes_m, kind);
  return result;
}

NodeWeights AxisInterpolation::at(double position_m) const {
  const BasisRow row = basis_row(nodes_m_, position_m);
  NodeWeights w;
  w.first_ = row.first;
  w.a_ = row.weight[0];
  w.b_ = row.weight[1];
  if (kind_ == Interpolation::Linear) {
    return w;
  }

  const std::size_t n = nodes_m_.size(), k = row.first;
  const double h_m = nodes_m_[k + 1] - nodes_m_[k], sixth = h_m * h_m / 6.0;
  w.first_ = 0;
  w.count_ = n;
  w.cell_ = k;
  w.curve_a_ = (w.a_ * w.a_ * w.a_ - w.a_) * sixth;
  w.curve_b_ = (w.b_ * w.b_ * w.b_ - w.b_) * sixth;
  w.below_ = curvature_.data() + k * n;
  w.above_ = w.below_ + n;
  return w;
}

}  // namespace abbe::calib
