#include "plan/plan_problem.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "abbe/calib/otf/run/path_frame.hpp"
#include "plan/plan_volume.hpp"

namespace abbe::calib::otf {
namespace {

double corner_exclusion_m() {
  return Options{}.corner_m;
}

/// Sum of row_i row_j M_ij for both rows of a point; M is symmetric.
double quadratic_form(const Eigen::MatrixXd& M, const PointRows& rows) {
  double sum = 0.0;
  for (std::size_t j = 0; j < rows.count; ++j) {
    const double* column = M.col(rows.column[j]).data();
    double of_a2 = 0.5 * column[rows.column[j]] * rows.along_a2[j];
    double of_a3 = 0.5 * column[rows.column[j]] * rows.along_a3[j];
    for (std::size_t i = 0; i < j; ++i) {
      const double m = column[rows.column[i]];
      of_a2 += m * rows.along_a2[i];
      of_a3 += m * rows.along_a3[i];
    }
    sum += 2.0 * (rows.along_a2[j] * of_a2 + rows.along_a3[j] * of_a3);
  }
  return sum;
}

/// Transpose of A M for the rows A of all points of a leg: one column per row.
Eigen::MatrixXd times_rows(const Eigen::MatrixXd& M, std::span<const PointRows> points) {
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(M.rows(), 2 * std::ssize(points));
  for (std::size_t k = 0; k < points.size(); ++k) {
    const PointRows& rows = points[k];
    auto of_a2 = product.col(2 * static_cast<Eigen::Index>(k));
    auto of_a3 = product.col(2 * static_cast<Eigen::Index>(k) + 1);
    for (std::size_t i = 0; i < rows.count; ++i) {
      of_a2 += rows.along_a2[i] * M.col(rows.column[i]);
      of_a3 += rows.along_a3[i] * M.col(rows.column[i]);
    }
  }
  return product;
}

/// A P for P from times_rows(): a symmetric matrix with one row and column per row of the leg.
Eigen::MatrixXd rows_times(std::span<const PointRows> points, const Eigen::MatrixXd& P) {
  Eigen::MatrixXd product(P.cols(), P.cols());
  for (Eigen::Index column = 0; column < P.cols(); ++column) {
    for (std::size_t k = 0; k < points.size(); ++k) {
      const PointRows& rows = points[k];
      double of_a2 = 0.0, of_a3 = 0.0;
      for (std::size_t i = 0; i < rows.count; ++i) {
        const double p = P(rows.column[i], column);
        of_a2 += rows.along_a2[i] * p;
        of_a3 += rows.along_a3[i] * p;
      }
      product(2 * static_cast<Eigen::Index>(k), column) = of_a2;
      product(2 * static_cast<Eigen::Index>(k) + 1, column) = of_a3;
    }
  }
  return product;
}

}  // namespace

PlanProblem::PlanProblem(const PlannedRun& run, const ParameterLayout& layout)
    : run_(run), layout_(layout) {
  const Eigen::Index n = unknowns();
  const RigidFreeVolume volume(layout, run.machine.target_offset_m);
  G_ = Eigen::MatrixXd::Zero(n, n);
  G_.topLeftCorner(volume.G().rows(), volume.G().cols()) = volume.G();

  // Eigenvalues of G that count as zero: those of combinations that only move V rigidly are
  // rounding errors.
  constexpr double kZero = 1e-13;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(G_);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  const auto rank = (values.array() > kZero * values(n - 1)).count();
  root_G_ = eigen.eigenvectors().rightCols(rank) * values.tail(rank).cwiseSqrt().asDiagonal();
}

std::size_t PlanProblem::points_of(const Leg& leg, double spacing_m) const {
  const double used_m = leg.length_m() - 2.0 * corner_exclusion_m();
  return used_m > 0.0 ? static_cast<std::size_t>(std::ceil(used_m / spacing_m)) : 0;
}

PointRows PlanProblem::rows_at(const Leg& leg, double share, std::size_t points) const {
  const double length_m = leg.length_m(), corner_m = corner_exclusion_m();
  const double along = (corner_m + share * (length_m - 2.0 * corner_m)) / length_m;
  const Vector3 q = leg.from_m + along * (leg.to_m - leg.from_m);
  const Vector3 p = q + run_.machine.target_offset_m;
  const PathFrame frame = path_frame(leg.to_m - leg.from_m, p - run_.tracker_m, run_.noise);
  const double samples = (length_m - 2.0 * corner_m) / static_cast<double>(points) *
                         run_.points_per_s / run_.drive.feed_m_per_s;
  const Vector3 a2 = std::sqrt(samples) / frame.sigma2_m * frame.a2,
                a3 = std::sqrt(samples) / frame.sigma3_m * frame.a3;

  const DesignColumns columns = design_columns_with_rigid(layout_, q, run_.machine.target_offset_m);
  PointRows rows;
  for (const Column& c : columns.span()) {
    rows.column[rows.count] = static_cast<Eigen::Index>(c.parameter);
    rows.along_a2[rows.count] = a2.dot(c.dV_dU);
    rows.along_a3[rows.count] = a3.dot(c.dV_dU);
    ++rows.count;
  }
  if (has_range_offset()) {
    const Vector3 beam = (p - run_.tracker_m).normalized();
    rows.column[rows.count] = unknowns() - 1;
    rows.along_a2[rows.count] = a2.dot(beam);
    rows.along_a3[rows.count] = a3.dot(beam);
    ++rows.count;
  }
  return rows;
}

Eigen::MatrixXd PlanProblem::prior() const {
  constexpr double kNode_m = 50e-6, kNode_rad = 100e-6;
  // Wide prior, because the alignment of a run has no prior.
  constexpr double kStation_m = 1e-3, kStation_rad = 1e-3;
  const auto n = static_cast<Eigen::Index>(layout_.fit_size());
  Eigen::VectorXd u = Eigen::VectorXd::Constant(unknowns(), kNode_rad);
  for (const Table& table : layout_.tables()) {
    u.segment(static_cast<Eigen::Index>(table.offset),
              static_cast<Eigen::Index>(layout_.node_count(table.motion.axis)))
        .setConstant(is_rotation(table.motion.motion) ? kNode_rad : kNode_m);
  }
  u.segment(n - 6, 3).setConstant(kStation_m);
  u.segment(n - 3, 3).setConstant(kStation_rad);
  if (has_range_offset()) {
    u(n) = run_.noise.u_range_offset_m;
  }
  return u.array().square().inverse().matrix().asDiagonal();
}

void PlanProblem::add(const Leg& leg, double factor, Eigen::MatrixXd& H, double spacing_m) const {
  const std::size_t points = points_of(leg, spacing_m);
  for (std::size_t k = 0; k < points; ++k) {
    const PointRows rows =
        rows_at(leg, (static_cast<double>(k) + 0.5) / static_cast<double>(points), points);
    for (std::size_t j = 0; j < rows.count; ++j) {
      double* column = H.col(rows.column[j]).data();
      const double a2 = factor * rows.along_a2[j], a3 = factor * rows.along_a3[j];
      for (std::size_t i = j; i < rows.count; ++i) {
        column[rows.column[i]] += a2 * rows.along_a2[i] + a3 * rows.along_a3[i];
      }
    }
  }
}

double PlanProblem::trace_with(const Eigen::MatrixXd& D, const Leg& leg, std::size_t points) const {
  double sum = 0.0;
  for (std::size_t k = 0; k < points; ++k) {
    const double share = (static_cast<double>(k) + 0.5) / static_cast<double>(points);
    sum += quadratic_form(D, rows_at(leg, share, points));
  }
  return sum;
}

double PlanProblem::gain(const PathState& state, const Leg& leg, std::size_t points) const {
  std::vector<PointRows> rows;
  for (std::size_t k = 0; k < points; ++k) {
    rows.push_back(
        rows_at(leg, (static_cast<double>(k) + 0.5) / static_cast<double>(points), points));
  }

  Eigen::MatrixXd S = rows_times(rows, times_rows(state.C, rows));
  S.diagonal().array() += 1.0;
  const Eigen::MatrixXd T = rows_times(rows, times_rows(state.D, rows));
  return S.llt().solve(T).trace();
}

PathState PlanProblem::state_of(Eigen::MatrixXd H) const {
  // H = L L^T:  trace(G C) = |L^-1 root_G|^2
  const Eigen::LLT<Eigen::MatrixXd> factor(H);
  PathState state;
  state.value_m2 = factor.matrixL().solve(root_G_).squaredNorm();
  state.H = std::move(H);
  return state;
}

PathState PlanProblem::state_of(const Path& path) const {
  Eigen::MatrixXd H = prior();
  for (std::size_t i = 1; i < path.vertices_m.size(); ++i) {
    add({path.vertices_m[i - 1], path.vertices_m[i]}, 1.0, H);
  }
  return state_of(std::move(H));
}

PathState PlanProblem::with_slope(PathState state) const {
  const Eigen::Index n = state.H.rows();
  state.C = Eigen::LLT<Eigen::MatrixXd>(state.H).solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd C_root = state.C * root_G_;
  state.D = C_root * C_root.transpose();
  return state;
}

}  // namespace abbe::calib::otf
