#include "abbe/calib/mfb/judge/judge.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <tuple>

#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"
#include "abbe/result/try.hpp"
#include "observe/without_pass.hpp"

namespace abbe::calib::mfb {
namespace {

/// Largest accepted ratio of the variance of a prediction to that of the point itself.
constexpr double kMostOfPrediction = 100.0;

/// Whitened rows of all passes and of the priors. Columns of the tables exist only for the
/// candidate.
enum class Unknowns { All, WithoutTables };

class StackedRows {
 public:
  StackedRows(const WholeSystem& system, Unknowns which)
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

  /// Residuals of the whitened data y after the least-squares fit; the values of the priors are 0.
  [[nodiscard]] Eigen::VectorXd residuals(const Eigen::VectorXd& y) const {
    const auto U = basis_.topRows(data_rows_);
    return y - U * (U.transpose() * y);
  }
  [[nodiscard]] Eigen::Index columns() const { return basis_.cols(); }
  /// The rows of an orthonormal basis of the columns that belong to one pass.
  [[nodiscard]] auto basis_of(Eigen::Index first, Eigen::Index count) const {
    return basis_.middleRows(first, count);
  }

 private:
  void set_rows(Eigen::MatrixXd& M, const WholeSystem& system) const {
    Eigen::Index row = 0, column = system.shared.size() - first_shared_;
    const Eigen::Index shared = column;
    for (const PositionSystem& p : system.positions) {
      M.block(row, 0, p.A.rows(), shared) = p.A.rightCols(shared);
      M.block(row, column, p.L.rows(), p.L.cols()) = p.L;
      row += p.A.rows();
      column += p.L.cols();
    }
  }

  /// Adds the rows of the priors. Bar and alpha are divided by their uncertainty, so that their
  /// prior is 1; tables have no prior.
  void set_priors(Eigen::Ref<Eigen::MatrixXd> M, const WholeSystem& system) const {
    Eigen::Index column = system.shared.size() - first_shared_;
    for (Eigen::Index i = system.shared.bar_offset() - first_shared_; i < column; ++i) {
      M(i, i) = 1.0;
    }
    for (const PositionSystem& p : system.positions) {
      for (const double u : p.layout.u) {
        M(column, column) = 1.0 / u;  // 0 if the unknown has no prior
        ++column;
      }
    }
  }

  Eigen::Index first_shared_, data_rows_ = 0;
  Eigen::MatrixXd basis_;
};

/// Whitened deviations of all passes after subtraction of the errors V of a model at the touches:
/// delta + D s, s_k = n_k . R^T V(q_k, t).
using ErrorsOfModel = std::function<Vector3(const Vector3& reading_m, const Vector3& tool_m)>;
Eigen::VectorXd whitened_deviations(const Observations& o, const WholeSystem& system,
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
            pass.normal[k].dot(R.transpose() * V(pass.reading_m[k], t));
      }
      const Eigen::VectorXd white = p.root[i].matrixL().solve(pass.delta_m + pass.dO_dtouch * s);
      all.insert(all.end(), white.data(), white.data() + white.size());
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(all.data(), std::ssize(all));
}

Eigen::VectorXd whitened_deviations(const WholeSystem& system) {
  std::vector<double> all;
  for (const PositionSystem& p : system.positions) {
    all.insert(all.end(), p.y.data(), p.y.data() + p.y.size());
  }
  return Eigen::Map<const Eigen::VectorXd>(all.data(), std::ssize(all));
}

/// O_i of one pass: its rows in the stacked data, and the matrix T, the columns of L^-1 that belong
/// to it.
struct PointOfPass {
  std::size_t measurement = 0, hole = 0;
  Eigen::Index first = 0, rows = 0;  ///< range of the rows of the pass
  Eigen::MatrixXd T;
  Matrix3 C = Matrix3::Zero();
};
/// O_i of all passes of one tool in one position. They are left out together, because the clamping
/// displaces a point equally in all of them.
using PointGroup = std::vector<PointOfPass>;

std::vector<PointGroup> point_groups(const Observations& o, const WholeSystem& system) {
  std::map<std::tuple<std::size_t, std::size_t, std::size_t>, PointGroup> groups;
  Eigen::Index first = 0;
  for (const PositionSystem& p : system.positions) {
    for (std::size_t i = 0; i < p.passes.size(); ++i) {
      const PassObservation& pass = o.passes[p.passes[i]];
      const Eigen::Index n = p.rows_of_pass;
      const Eigen::MatrixXd inverse = p.root[i].matrixL().solve(Eigen::MatrixXd::Identity(n, n));
      const Eigen::MatrixXd C = p.root[i].reconstructedMatrix();
      for (Eigen::Index at = 0; at < n; at += 3) {
        const auto hole = static_cast<std::size_t>(at / 3);
        groups[{pass.position, pass.tool, hole}].push_back(
            {pass.measurement, hole, first, n, inverse.middleCols(at, 3), C.block<3, 3>(at, at)});
      }
      first += n;
    }
  }
  std::vector<PointGroup> out;
  for (auto& [key, group] : groups) {
    out.push_back(std::move(group));
  }
  return out;
}

/// The matrix Q_gg of a group (judge.hpp), and the inverse of the group's covariance.
struct PrecisionOfGroup {
  Eigen::MatrixXd Q, C_inverse;

  PrecisionOfGroup(const StackedRows& rows, const PointGroup& group) {
    const auto size = 3 * std::ssize(group);
    Q = C_inverse = Eigen::MatrixXd::Zero(size, size);
    Eigen::MatrixXd Z(rows.columns(), size);
    for (std::size_t i = 0; i < group.size(); ++i) {
      const PointOfPass& p = group[i];
      const auto at = 3 * static_cast<Eigen::Index>(i);
      Z.middleCols(at, 3) = rows.basis_of(p.first, p.rows).transpose() * p.T;
      Q.block<3, 3>(at, at) = p.T.transpose() * p.T;
      C_inverse.block<3, 3>(at, at) = p.C.inverse();
    }
    Q -= Z.transpose() * Z;
  }
  /// True if the other points predict the group: Q^-1 is at most kMostOfPrediction times the
  /// covariance.
  [[nodiscard]] bool is_predicted() const {
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(Q, C_inverse,
                                                                          Eigen::EigenvaluesOnly);
    return eigen.eigenvalues()(0) > 1.0 / kMostOfPrediction;
  }
};

/// Squared deviation of a left-out point from its prediction.
struct LeftOutPoint {
  double chi2 = 0.0, squares_m2 = 0.0;
};
/// The key is the measurement and the hole.
using LeftOutPoints = std::map<std::pair<std::size_t, std::size_t>, LeftOutPoint>;

/// Computes all predictions. `predicted`: the rows that decide whether a point can be predicted.
LeftOutPoints left_out(const Observations& o, const WholeSystem& system, const StackedRows& rows,
                       const StackedRows& predicted, const Eigen::VectorXd& y) {
  LeftOutPoints points;
  const Eigen::VectorXd residuals = rows.residuals(y);
  for (const PointGroup& group : point_groups(o, system)) {
    const PrecisionOfGroup precision(rows, group);
    const bool usable = &rows == &predicted ? precision.is_predicted()
                                            : PrecisionOfGroup(predicted, group).is_predicted();
    if (!usable) {
      continue;
    }
    Eigen::VectorXd Qy(precision.Q.rows());
    for (std::size_t i = 0; i < group.size(); ++i) {
      Qy.segment<3>(3 * static_cast<Eigen::Index>(i)) =
          group[i].T.transpose() * residuals.segment(group[i].first, group[i].rows);
    }
    const Eigen::VectorXd e = precision.Q.ldlt().solve(Qy);
    for (std::size_t i = 0; i < group.size(); ++i) {
      const Vector3 e_i = e.segment<3>(3 * static_cast<Eigen::Index>(i));
      points[{group[i].measurement, group[i].hole}] = {e_i.dot(group[i].C.inverse() * e_i),
                                                       e_i.squaredNorm()};
    }
  }
  return points;
}

/// Accumulates root mean squares over points.
struct FigureOfPoints {
  double chi2 = 0.0, squares_m2 = 0.0, rows = 0.0;

  void add(const LeftOutPoint& point) {
    chi2 += point.chi2;
    squares_m2 += point.squares_m2;
    rows += 3.0;
  }
  [[nodiscard]] double figure() const { return rows > 0.0 ? std::sqrt(chi2 / rows) : 0.0; }
  [[nodiscard]] double rms_m() const { return rows > 0.0 ? std::sqrt(squares_m2 / rows) : 0.0; }
};
FigureOfPoints figure_of(const LeftOutPoints& points) {
  FigureOfPoints sum;
  for (const auto& [key, point] : points) {
    sum.add(point);
  }
  return sum;
}

Eigen::VectorXd deviations_with_tables(const Observations& o, const WholeSystem& system,
                                       const Eigen::VectorXd& U) {
  return whitened_deviations(o, system, [&](const Vector3& q, const Vector3& t) {
    return o.basis.V_m({.q_m = q, .tool_offset_m = t},
                       {U.data(), static_cast<std::size_t>(U.size())});
  });
}

/// True if the reading at O_i of a pass is in the validity volume of a model. The volume is
/// enlarged by the amount by which the volumes of two calibrations typically differ.
bool is_inside(const Observations& o, const PassObservation& pass, std::size_t hole,
               const ValidityVolume& volume) {
  constexpr double kWidened = 1.04;
  Vector3 centre = Vector3::Zero();
  for (const Vector3& v : volume.vertices_m()) {
    centre += v / static_cast<double>(volume.vertices_m().size());
  }
  const BarPose& pose = o.positions[pass.position].pose;
  const Vector3 reading = pose.origin_m + pose.axes * o.bar.O_m[hole] -
                          o.plan.measurements[pass.measurement].tool_offset_m;
  return volume.contains(centre + (reading - centre) / kWidened);
}

/// Keeps the passes with a tool for which `model` is valid, and with at least half of their points
/// in its validity volume.
Observations passes_of_model(const Observations& all, const VolumetricModel& model) {
  Observations o = all;
  for (std::size_t i = o.passes.size(); i-- > 0;) {
    const PassObservation& pass = o.passes[i];
    std::size_t inside = 0;
    for (std::size_t hole = 0; hole < o.bar.O_m.size(); ++hole) {
      inside += is_inside(o, pass, hole, model.validity()) ? 1 : 0;
    }
    const Vector3& t = o.plan.measurements[pass.measurement].tool_offset_m;
    if (!model.holds_for_tool(t) || 2 * inside < o.bar.O_m.size()) {
      o = without_pass(o, i);
    }
  }
  return o;
}

/// Adds the comparison with the active model at the points inside its volume. It uses separate
/// observations, without passes for which the active model is not valid.
Result<void> compare_with_active(HeldOutFigures& figures, const Observations& all,
                                 const LeftOutPoints& of_candidate, const VolumetricModel& active,
                                 const SolveOptions& options) {
  const Observations o = passes_of_model(all, active);
  if (o.passes.empty()) {
    return {};
  }
  const Result<WholeSystem> system = whole_system(o, nuisance_options(options));
  ABBE_TRY(system);
  const StackedRows own(*system, Unknowns::WithoutTables);
  const LeftOutPoints of_active = left_out(
      o, *system, own, own,
      whitened_deviations(o, *system,
                          [&](const Vector3& q, const Vector3& t) { return active.V_at(q, t); }));

  FigureOfPoints in_use, beside;
  for (const PassObservation& pass : o.passes) {
    for (std::size_t hole = 0; hole < o.bar.O_m.size(); ++hole) {
      const auto key = std::pair(pass.measurement, hole);
      const auto a = of_active.find(key);
      const auto c = of_candidate.find(key);
      if (a == of_active.end() || c == of_candidate.end() ||
          !is_inside(o, pass, hole, active.validity())) {
        continue;
      }
      in_use.add(a->second);
      beside.add(c->second);
    }
  }
  if (in_use.rows > 0.0) {
    figures.observations_beside_active = static_cast<std::size_t>(in_use.rows);
    figures.active = in_use.figure();
    figures.active_rms_m = in_use.rms_m();
    figures.candidate_beside_active = beside.figure();
  }
  return {};
}

}  // namespace

Result<HeldOutFigures> held_out(const Observations& o, const Solution& solution,
                                const VolumetricModel* active, const SolveOptions& options) {
  const Result<WholeSystem> system = whole_system(o, nuisance_options(options));
  ABBE_TRY(system);
  const StackedRows own(*system, Unknowns::WithoutTables);
  const StackedRows all(*system, Unknowns::All);
  const Eigen::VectorXd y = whitened_deviations(*system);
  const LeftOutPoints none = left_out(o, *system, own, all, y);
  const LeftOutPoints candidate =
      options.estimator == Estimator::Simultaneous
          ? left_out(o, *system, all, all, y)
          : left_out(o, *system, own, all, deviations_with_tables(o, *system, solution.U));

  HeldOutFigures figures;
  figures.observations = 3 * candidate.size();
  figures.not_held_out = 3 * o.passes.size() * o.bar.O_m.size() - figures.observations;
  figures.no_compensation = figure_of(none).figure();
  figures.candidate = figure_of(candidate).figure();
  figures.no_compensation_rms_m = figure_of(none).rms_m();
  figures.candidate_rms_m = figure_of(candidate).rms_m();
  if (active != nullptr) {
    ABBE_TRY(compare_with_active(figures, o, candidate, *active, options));
  }
  return figures;
}

}  // namespace abbe::calib::mfb
