#include "abbe/calib/internal/mfb/solve/position_system.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {
namespace {

/// Standard uncertainty that is added to each coordinate of O_i for effects that the rows neglect:
/// 1 to 10 nm of the exact transforms, and the derivatives of the nominal instead of the real bar.
/// Without it some combinations of O_i would have almost no noise: the N values O_z depend on the
/// heights of only N - 1 rods, so that their covariance is singular except for the shifts of the
/// signature.
constexpr double kNeglected_m = 3e-9;

/// The product D D^T. It uses that a touch has an effect on few O_i.
Eigen::MatrixXd times_own_transpose(const Eigen::MatrixXd& D) {
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(D.rows(), D.rows());
  std::vector<Eigen::Index> rows;
  for (Eigen::Index k = 0; k < D.cols(); ++k) {
    rows.clear();
    for (Eigen::Index i = 0; i < D.rows(); ++i) {
      if (D(i, k) != 0.0) {
        rows.push_back(i);
      }
    }
    for (const Eigen::Index i : rows) {
      for (const Eigen::Index j : rows) {
        product(i, j) += D(i, k) * D(j, k);
      }
    }
  }
  return product;
}

Eigen::Index priors_of(const NuisanceLayout& layout) {
  return std::count_if(layout.u.begin(), layout.u.end(), [](double u) { return std::isfinite(u); });
}

/// Appends the whitened rows [L | A | y] of one pass.
void append_pass(PositionSystem& system, Eigen::Index first, const RowMajorRows& A,
                 const Eigen::MatrixXd& L, const Eigen::VectorXd& y, const RootOfNoise& root) {
  system.A.middleRows(first, A.rows()) = root.matrixL().solve(A);
  system.L.middleRows(first, A.rows()) = root.matrixL().solve(L);
  system.y.segment(first, A.rows()) = root.matrixL().solve(y);
}

/// The rows of L followed by one row per prior.
Eigen::MatrixXd with_prior_rows(const PositionSystem& s) {
  const Eigen::Index data = s.L.rows();
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(data + priors_of(s.layout), s.L.cols());
  all.topRows(data) = s.L;
  Eigen::Index row = data;
  for (std::size_t k = 0; k < s.layout.u.size(); ++k) {
    if (std::isfinite(s.layout.u[k])) {
      all(row++, static_cast<Eigen::Index>(k)) = 1.0 / s.layout.u[k];
    }
  }
  return all;
}

/// Householder reflections of the nuisances; applied to rows that are stored by rows.
class EliminationOfNuisances {
 public:
  explicit EliminationOfNuisances(const PositionSystem& s) : qr_(with_prior_rows(s)) {}

  [[nodiscard]] Eigen::MatrixXd R() const {
    const Eigen::Index n = qr_.cols();
    return qr_.matrixQR().topRows(n).triangularView<Eigen::Upper>();
  }
  /// Computes Q^T rows. Each reflection I - tau v v^T reads the rows once for the sum and once for
  /// the change, in the order of memory.
  void apply(RowMajorRows& rows) const {
    Eigen::RowVectorXd sum(rows.cols());
    for (Eigen::Index k = 0; k < qr_.cols(); ++k) {
      const double tau = qr_.hCoeffs()(k);
      sum = rows.row(k);
      for (Eigen::Index i = k + 1; i < rows.rows(); ++i) {
        add(sum.data(), qr_.matrixQR()(i, k), rows.row(i).data(), rows.cols());
      }
      rows.row(k) -= tau * sum;
      for (Eigen::Index i = k + 1; i < rows.rows(); ++i) {
        add(rows.row(i).data(), -tau * qr_.matrixQR()(i, k), sum.data(), rows.cols());
      }
    }
  }

 private:
  static void add(double* __restrict to, double factor, const double* from, Eigen::Index count) {
    for (Eigen::Index c = 0; c < count; ++c) {
      to[c] += factor * from[c];
    }
  }

  Eigen::HouseholderQR<Eigen::MatrixXd> qr_;
};

Result<void> eliminate_nuisances(PositionSystem& s, const std::string& position) {
  const Eigen::Index shared = s.A.cols(), nuisances = s.L.cols();
  const EliminationOfNuisances elimination(s);
  RowMajorRows rows = RowMajorRows::Zero(s.A.rows() + priors_of(s.layout), shared + 1);
  rows.topLeftCorner(s.A.rows(), shared) = s.A;
  rows.topRightCorner(s.A.rows(), 1) = s.y;
  elimination.apply(rows);

  constexpr double kZero = 1e-11;
  s.R = elimination.R();
  const Eigen::VectorXd relative =
      s.R.diagonal().cwiseAbs().cwiseQuotient(s.R.colwise().norm().transpose());
  if (!(relative.minCoeff() > kZero)) {
    return failure(ErrorCode::RankDeficient,
                   message("position ", position,
                           ": the passes do not determine pose, tools and drift of the bar"));
  }

  const Eigen::Index rest = rows.rows() - nuisances;
  s.G = rows.topLeftCorner(nuisances, shared);
  s.z = rows.topRightCorner(nuisances, 1);
  s.E = rows.bottomLeftCorner(rest, shared);
  s.e = rows.bottomRightCorner(rest, 1);
  return {};
}

}  // namespace

Result<RootOfNoise> root_of_noise(const TouchNoise& noise, const PassObservation& pass) {
  const double variance_m2 = noise.probe_m * noise.probe_m + noise.machine_m * noise.machine_m;
  Eigen::MatrixXd covariance_m2 = variance_m2 * times_own_transpose(pass.dO_dtouch);
  covariance_m2.diagonal().array() += kNeglected_m * kNeglected_m;
  RootOfNoise root(covariance_m2);
  if (root.info() != Eigen::Success) {
    return failure(ErrorCode::DegenerateGeometry,
                   "bar: the touches do not determine all points of interest");
  }
  return root;
}

Eigen::VectorXd PositionSystem::nuisances(const Eigen::VectorXd& x) const {
  return R.triangularView<Eigen::Upper>().solve(z - G * x);
}

Result<PositionSystem> position_system(const Observations& o, std::size_t position,
                                       const SharedUnknowns& shared,
                                       const NuisanceOptions& options) {
  PositionSystem s;
  s.passes = passes_of(o, position);
  s.layout = nuisance_layout(o, position, options);
  s.rows_of_pass = 3 * std::ssize(o.bar.O_m);
  const Eigen::Index rows = s.rows_of_pass * std::ssize(s.passes);
  s.A.resize(rows, shared.size());
  s.L.resize(rows, s.layout.size);
  s.y.resize(rows);

  for (std::size_t k = 0; k < s.passes.size(); ++k) {
    const PassObservation& pass = o.passes[s.passes[k]];
    Result<RootOfNoise> root = root_of_noise(o.plan.noise, pass);
    ABBE_TRY(root);
    append_pass(s, s.rows_of_pass * static_cast<Eigen::Index>(k), shared_rows(o, pass, shared),
                nuisance_rows(o, pass, k, s.layout, options), pass.delta_m, *root);
    s.root.push_back(*std::move(root));
  }
  ABBE_TRY(eliminate_nuisances(s, o.positions[position].name));
  return s;
}

Eigen::MatrixXd gain_rows(const PositionSystem& s) {
  const EliminationOfNuisances elimination(s);
  const Eigen::Index data = s.A.rows();
  RowMajorRows turned = RowMajorRows::Zero(data + priors_of(s.layout), data);
  turned.topRows(data).setIdentity();
  elimination.apply(turned);

  Eigen::MatrixXd gain = s.E.transpose() * turned.bottomRows(s.E.rows());
  for (std::size_t k = 0; k < s.passes.size(); ++k) {  // multiplies by the inverse of the root of
                                                       // the noise
    auto part = gain.middleCols(s.rows_of_pass * static_cast<Eigen::Index>(k), s.rows_of_pass);
    part = s.root[k].matrixU().solve(part.transpose()).transpose().eval();
  }
  return gain;
}

void add_shared_priors(estimation::Information& data, const SharedUnknowns& shared) {
  for (Eigen::Index k = shared.bar_offset(); k < shared.size(); ++k) {
    data.add_prior(static_cast<std::size_t>(k), 0.0, 1.0);
  }
}

}  // namespace abbe::calib::mfb
