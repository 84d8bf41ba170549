#include "abbe/calib/mfb/judge.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "message.hpp"
#include "mfb/joint.hpp"
#include "units.hpp"

namespace abbe::calib::mfb {
namespace {

/// Each of the three variances of a prediction is at most this factor above that of the point.
constexpr double kMostOfPrediction = 100.0;

/// Whitened rows of all passes and of the priors. Columns of the tables: only for the candidate.
enum class Unknowns { All, WithoutTables };

class StackedRows {
 public:
  StackedRows(const JointSystem& system, Unknowns which)
      : first_shared_(which == Unknowns::All ? 0 : system.shared.bar_offset()) {
    Eigen::Index rows = 0, columns = system.shared.size() - first_shared_;
    for (const PositionSystem& p : system.positions) {
      rows += p.y.size();
      columns += p.layout.size;
    }
    const Eigen::Index priors = columns;
    Eigen::MatrixXd M = Eigen::MatrixXd::Zero(rows + priors, columns);
    set_rows(M, system);
    set_priors(M.bottomRows(priors), system);

    const Eigen::VectorXd size = M.colwise().norm().cwiseMax(1e-300);
    M = M * size.cwiseInverse().asDiagonal();
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(M);
    basis_ = qr.householderQ() * Eigen::MatrixXd::Identity(M.rows(), qr.rank());
    data_rows_ = rows;
  }

  /// Residuals of whitened data y; priors are 0.
  [[nodiscard]] Eigen::VectorXd residuals(const Eigen::VectorXd& y) const {
    const auto U = basis_.topRows(data_rows_);
    return y - U * (U.transpose() * y);
  }
  /// The rows of an orthonormal basis of the columns that belong to one pass.
  [[nodiscard]] auto basis_of(Eigen::Index first, Eigen::Index count) const {
    return basis_.middleRows(first, count);
  }

 private:
  void set_rows(Eigen::MatrixXd& M, const JointSystem& system) const {
    Eigen::Index row = 0, column = system.shared.size() - first_shared_;
    const Eigen::Index shared = column;
    for (const PositionSystem& p : system.positions) {
      M.block(row, 0, p.A.rows(), shared) = p.A.rightCols(shared);
      M.block(row, column, p.L.rows(), p.L.cols()) = p.L;
      row += p.A.rows();
      column += p.L.cols();
    }
  }

  /// The bar and alpha are in units of their uncertainty; tables have no prior.
  void set_priors(Eigen::Ref<Eigen::MatrixXd> M, const JointSystem& system) const {
    Eigen::Index column = system.shared.size() - first_shared_;
    for (Eigen::Index i = system.shared.bar_offset() - first_shared_; i < column; ++i) {
      M(i, i) = 1.0;
    }
    for (const PositionSystem& p : system.positions) {
      for (const double u : p.layout.u) {
        M(column, column) = 1.0 / u;  // 0 without a prior
        ++column;
      }
    }
  }

  Eigen::Index first_shared_, data_rows_ = 0;
  Eigen::MatrixXd basis_;
};

/// The whitened deviations of all passes, after the errors V of a model at its touches are taken out:
/// delta + D s, s_k = n_k . R^T V(q_k, t).
using ErrorsOfModel = std::function<Vector3(const Vector3& reading_m, const Vector3& tool_m)>;
Eigen::VectorXd whitened_deviations(const Observations& o, const JointSystem& system,
                                    const ErrorsOfModel& V) {
  std::vector<double> all;
  for (const PositionSystem& p : system.positions) {
    for (std::size_t i = 0; i < p.passes.size(); ++i) {
      const PassObservation& pass = o.passes[p.passes[i]];
      const Matrix3& R = o.positions[pass.position].pose.axes;
      const Vector3& t = o.plan.measurements[pass.measurement].tool_offset_m;
      Eigen::VectorXd s(std::ssize(pass.touched));
      for (std::size_t k = 0; k < pass.touched.size(); ++k) {
        s(static_cast<Eigen::Index>(k)) =
            system.touches[pass.touched[k]].outward.dot(R.transpose() * V(pass.reading_m[k], t));
      }
      const Eigen::VectorXd white = p.root[i]->matrixL().solve(pass.delta_m + pass.dO_dtouch * s);
      all.insert(all.end(), white.data(), white.data() + white.size());
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(all.data(), std::ssize(all));
}

Eigen::VectorXd whitened_deviations(const JointSystem& system) {
  std::vector<double> all;
  for (const PositionSystem& p : system.positions) {
    all.insert(all.end(), p.y.data(), p.y.data() + p.y.size());
  }
  return Eigen::Map<const Eigen::VectorXd>(all.data(), std::ssize(all));
}

/// Sums over the points of interest that were left out.
struct LeftOut {
  double chi2 = 0.0, squares_m2 = 0.0;
  std::size_t rows = 0;

  [[nodiscard]] double figure() const { return rows > 0 ? std::sqrt(chi2 / count()) : 0.0; }
  [[nodiscard]] double rms_m() const { return rows > 0 ? std::sqrt(squares_m2 / count()) : 0.0; }
  [[nodiscard]] double count() const { return static_cast<double>(rows); }
};

/// One O_i of one pass: rows in the stacked data, and T = L^-1 of its columns.
struct PointOfPass {
  std::size_t pass = 0;
  Eigen::Index first = 0, rows = 0;  ///< of the pass
  Eigen::MatrixXd T;
  Matrix3 C = Matrix3::Zero();  ///< covariance of the point
};

std::vector<PointOfPass> points_of_passes(const JointSystem& system) {
  std::vector<PointOfPass> points;
  Eigen::Index first = 0;
  for (const PositionSystem& p : system.positions) {
    for (std::size_t i = 0; i < p.passes.size(); ++i) {
      const Eigen::Index n = p.rows_of_pass;
      const Eigen::MatrixXd inverse = p.root[i]->matrixL().solve(Eigen::MatrixXd::Identity(n, n));
      const Eigen::MatrixXd C = p.root[i]->reconstructedMatrix();
      for (Eigen::Index at = 0; at < n; at += 3) {
        points.push_back({p.passes[i], first, n, inverse.middleCols(at, 3), C.block<3, 3>(at, at)});
      }
      first += n;
    }
  }
  return points;
}

/// Q_ii of a point.
Matrix3 precision_of(const StackedRows& rows, const PointOfPass& point) {
  const Eigen::MatrixXd UT = rows.basis_of(point.first, point.rows).transpose() * point.T;
  return point.T.transpose() * point.T - UT.transpose() * UT;
}

/// The others predict the point: Q_ii^-1 is at most kMostOfPrediction times its covariance.
bool is_predicted(const Matrix3& Q, const Matrix3& C) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix3> eigen(Q, C.inverse(),
                                                                Eigen::EigenvaluesOnly);
  return eigen.eigenvalues()(0) > 1.0 / kMostOfPrediction;
}

void add_point(LeftOut& sum, const StackedRows& rows, const PointOfPass& point,
               const Eigen::VectorXd& residuals) {
  const Vector3 Qy = point.T.transpose() * residuals.segment(point.first, point.rows);
  const Vector3 e = precision_of(rows, point).ldlt().solve(Qy);
  sum.chi2 += e.dot(point.C.ldlt().solve(e));
  sum.squares_m2 += e.squaredNorm();
  sum.rows += 3;
}

/// Passes inside the validity volume of a model, for whose tool it is valid.
std::set<std::size_t> passes_inside(const Observations& o, const VolumetricModel& model) {
  std::set<std::size_t> passes;
  for (std::size_t i = 0; i < o.passes.size(); ++i) {
    const PassObservation& pass = o.passes[i];
    const bool holds = model.holds_for_tool(o.plan.measurements[pass.measurement].tool_offset_m) &&
                       std::ranges::all_of(pass.reading_m, [&](const Vector3& q) {
                         return model.validity().contains(q);
                       });
    if (holds) {
      passes.insert(i);
    }
  }
  return passes;
}

Eigen::VectorXd deviations_with_tables(const Observations& o, const JointSystem& system,
                                       const Eigen::VectorXd& U) {
  return whitened_deviations(o, system, [&](const Vector3& q, const Vector3& t) {
    return o.basis.V_m({.q_m = q, .tool_offset_m = t},
                       {U.data(), static_cast<std::size_t>(U.size())});
  });
}

/// Adds chi-square, with its likely cause, as the first reason.
void judge_chi_square(Verdict& verdict, const Identification& found) {
  const Statistics& s = found.solution.statistics;
  if (s.chi2_per_dof <= s.chi2_per_dof_limit) {
    return;
  }
  const std::string seen = message("chi-square per degree of freedom is ", s.chi2_per_dof,
                                   ", at most ", s.chi2_per_dof_limit);
  verdict.refuse(name(found.cause.cause), found.cause.text.empty() ? seen : found.cause.text, 0);
}

void note_set_aside(Verdict& verdict, const Identification& found) {
  for (const SetAsideTouch& touch : found.set_aside) {
    verdict.notes.push_back(message(touch.measurement_name, ": ", name(touch.target),
                                    " is set aside: it is ", kUmPerM * touch.residual_m,
                                    " um off its feature"));
  }
}

}  // namespace

Result<HeldOutFigures> held_out(const Observations& o, const Solution& solution,
                                const VolumetricModel* active, const SolveOptions& options) {
  const Result<JointSystem> system = joint_system(o, nuisance_options(options));
  if (!system) {
    return tl::unexpected(system.error());
  }
  const bool joint = options.estimator == Estimator::Joint;
  const StackedRows own(*system, Unknowns::WithoutTables);
  const StackedRows all = joint ? StackedRows(*system, Unknowns::All) : own;
  const Eigen::VectorXd y = whitened_deviations(*system);
  const Eigen::VectorXd of_none = own.residuals(y);
  const Eigen::VectorXd of_candidate =
      joint ? all.residuals(y) : own.residuals(deviations_with_tables(o, *system, solution.U));

  std::set<std::size_t> inside;
  Eigen::VectorXd of_active;
  if (active != nullptr) {
    inside = passes_inside(o, *active);
    of_active = own.residuals(whitened_deviations(
        o, *system, [&](const Vector3& q, const Vector3& t) { return active->V_at(q, t); }));
  }

  HeldOutFigures figures;
  LeftOut none, candidate, beside, in_use;
  for (const PointOfPass& point : points_of_passes(*system)) {
    if (!is_predicted(precision_of(all, point), point.C)) {
      figures.not_held_out += 3;
      continue;
    }
    add_point(none, own, point, of_none);
    add_point(candidate, all, point, of_candidate);
    if (inside.contains(point.pass)) {
      add_point(in_use, own, point, of_active);
      add_point(beside, all, point, of_candidate);
    }
  }

  figures.observations = candidate.rows;
  figures.no_compensation = none.figure();
  figures.candidate = candidate.figure();
  figures.no_compensation_rms_m = none.rms_m();
  figures.candidate_rms_m = candidate.rms_m();
  if (in_use.rows > 0) {
    figures.observations_beside_active = in_use.rows;
    figures.active = in_use.figure();
    figures.active_rms_m = in_use.rms_m();
    figures.candidate_beside_active = beside.figure();
  }
  return figures;
}

Result<Verdict> judge(const Identification& found, const VolumetricModel* active,
                      const JudgeOptions& options) {
  const Result<HeldOutFigures> figures =
      held_out(found.observations, found.solution, active, options.solve);
  if (!figures) {
    return tl::unexpected(figures.error());
  }
  Verdict verdict = decide(found.model, *figures, options.limits, active);
  judge_chi_square(verdict, found);
  note_set_aside(verdict, found);
  verdict.notes.insert(verdict.notes.end(), found.notes.begin(), found.notes.end());
  if (options.solve.estimator == Estimator::Sequential) {
    verdict.notes.emplace_back(
        "the published sequence is not fitted again without the points that are left out");
  }
  verdict.accepted = verdict.reasons.empty();
  return verdict;
}

}  // namespace abbe::calib::mfb
