#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "abbe/calib/estimation/information.hpp"
#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/otf/solve/prewhitening.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"
#include "solve/datum_of.hpp"
#include "solve/noise_whitening.hpp"
#include "solve/priors.hpp"

namespace abbe::calib::otf {
namespace {

/// Parameters x of the slow noise. They are the logarithms of the variances of ranges, angles and
/// scale readings, divided by the white noise of the rows; the last one is the logarithm of the
/// correlation time.
using Parameters = Eigen::VectorXd;

/// First and last source (noise_series.hpp) to which each variance parameter applies.
constexpr std::array<std::array<std::size_t, 2>, 3> kSourcesOf{{{0, 0}, {1, 2}, {3, 3}}};

class Scales {
 public:
  explicit Scales(const NoiseSeries& series) : variances_(series.sources - 1) {
    std::array<double, 3> rows{};
    for (const NoiseResponse& r : series.response) {
      const std::array squares{r[0] * r[0], r[1] * r[1] + r[2] * r[2], r[3] * r[3]};
      for (std::size_t k = 0; k < variances_; ++k) {
        mean_square_[k] += squares[k];
        rows[k] += squares[k] > 0.0 ? 1.0 : 0.0;
      }
    }
    for (std::size_t k = 0; k < variances_; ++k) {
      mean_square_[k] = rows[k] > 0.0 ? mean_square_[k] / rows[k] : 0.0;
    }
  }

  [[nodiscard]] Eigen::Index variances() const { return static_cast<Eigen::Index>(variances_); }
  [[nodiscard]] SlowNoise noise(const Parameters& x) const {
    SlowNoise noise;
    for (std::size_t k = 0; k < variances_; ++k) {
      for (const std::size_t source : kSourcesOf[k]) {
        noise.variance[source] =
            mean_square_[k] > 0.0 ? exponential(x(static_cast<Eigen::Index>(k))) / mean_square_[k]
                                  : 0.0;
      }
    }
    noise.correlation_time = exponential(x(x.size() - 1));
    return noise;
  }

 private:
  std::size_t variances_;
  std::array<double, 3> mean_square_{};
};

double least_node_distance_m(const Observations& o) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const Axis axis : kAllAxes) {
    const std::vector<double>& nodes_m = o.layout().nodes()[index(axis)].nodes_m;
    for (std::size_t i = 1; i < nodes_m.size(); ++i) {
      least_m = std::min(least_m, nodes_m[i] - nodes_m[i - 1]);
    }
  }
  return least_m;
}

/// Largest travel of a group of segments; 0 if there are too few rows to group them. Groups that
/// are short compared with the distance of the nodes contain nearly all information of the rows
/// about U, and take a third of the time.
double group_m(const Observations& o) {
  constexpr double kLongestGroup_m = 25e-3, kOfNodeDistance = 0.5;
  constexpr std::size_t kEnoughRows = 10;  // rows per unknown
  return o.rows.size() > kEnoughRows * o.unknowns()
             ? std::min(kLongestGroup_m, kOfNodeDistance * least_node_distance_m(o))
             : 0.0;
}

/// Replaces every row w of W by w R^-1, R upper triangular.
void solve_from_right(const RowMatrix& R, RowMatrix& W) {
  for (Eigen::Index at = 0; at < W.rows(); ++at) {
    double* const w = W.row(at).data();
    for (Eigen::Index i = 0; i < R.rows(); ++i) {
      const double* const r = R.row(i).data();
      w[i] /= r[i];
      const double solved = w[i];
      for (Eigen::Index j = i + 1; j < R.cols(); ++j) {
        w[j] -= solved * r[j];
      }
    }
  }
}

double squares(const RowMatrix& rows) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    for (Eigen::Index j = 0; j < rows.cols(); ++j) {
      sum += rows(i, j) * rows(i, j);
    }
  }
  return sum;
}

/// Derivative of log |A^T V^-1 A| (including priors) by the noise, and the generalised least
/// squares solution, computed from the grouped rows.
class AboutUnknowns {
 public:
  AboutUnknowns(const Observations& o, const NoiseSeries& series,
                std::span<const double> residual_m)
      : o_(o), groups_(grouped(series, o, group_m(o))), K_(datum_of(o).conditions()) {
    const auto n = static_cast<Eigen::Index>(o.unknowns());
    RowMatrix rows = RowMatrix::Zero(std::ssize(o.rows), n + 1);
    for (std::size_t i = 0; i < o.rows.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      for (const SparseRows::Entry& e : o.A.row(i)) {
        rows(at, static_cast<Eigen::Index>(e.column)) = e.value / o.rows[i].sigma_m;
      }
      rows(at, n) = residual_m[i] / o.rows[i].sigma_m;
    }
    rows_ = groups_.sums(rows);
    const Eigen::VectorXd length = rows_.leftCols(n).colwise().norm();
    scale_ = length.unaryExpr([](double l) { return l > 0.0 ? 1.0 / l : 1.0; });
    K_ = (K_ * scale_.asDiagonal()).rowwise().normalized();
  }

  /// Solution with the triangle R of N = A^T V^-1 A + priors + K^T K = R^T R; the unknowns are
  /// divided by scale_.
  struct Fit {
    Eigen::MatrixXd R;
    Eigen::VectorXd U;
  };
  /// Computes the solution for a noise. `white_factor`: weight of the prior for smooth tables.
  [[nodiscard]] Fit fit(const SlowNoise& noise, double white_factor) const {
    const auto n = scale_.size();
    RowMatrix rows = rows_;
    NoiseWhitening(groups_.series, noise).apply(rows);
    estimation::Information data(o_.unknowns());
    data.add_rows(rows.leftCols(n), rows.col(n));
    data = with_priors(std::move(data), with_factor(white_factor));

    estimation::Information bordered(o_.unknowns());
    bordered.add_rows(data.R() * scale_.asDiagonal(), data.z());
    bordered.add_rows(K_, Eigen::VectorXd::Zero(K_.rows()));
    Fit found;
    found.R = bordered.R();
    found.U = scale_.asDiagonal() *
              Eigen::VectorXd(found.R.triangularView<Eigen::Upper>().solve(bordered.z()));
    return found;
  }

  /// Derivative of log |N| by the noise parameters x, at the noise of a fit. Priors and K do not
  /// depend on x. With A = W R and V = L L^T,
  ///     d log |N| = tr(R^-T d(A^T V^-1 A) R^-1) = d |L^-1 W|^2,   |.|^2: sum of squares
  [[nodiscard]] Eigen::VectorXd slope(const Fit& at, const Scales& scales,
                                      const Parameters& x) const {
    constexpr double kStep = 1e-4;  // step of a logarithm
    RowMatrix W = rows_.leftCols(scale_.size()) * scale_.asDiagonal();
    solve_from_right(at.R, W);
    const auto squares_at = [&](const Parameters& noise) {
      RowMatrix whitened = W;
      NoiseWhitening(groups_.series, scales.noise(noise)).apply(whitened);
      return squares(whitened);
    };

    const double at_x = squares_at(x);
    Eigen::VectorXd slope(x.size());
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      Parameters moved = x;
      moved(k) += kStep;
      slope(k) = (squares_at(moved) - at_x) / kStep;
    }
    return slope;
  }

  [[nodiscard]] const GroupedSeries& groups() const { return groups_; }

 private:
  [[nodiscard]] Observations with_factor(double white_factor) const {
    Observations priors{
        .basis = o_.basis, .clock_unknowns = o_.clock_unknowns, .smoothness = o_.smoothness};
    if (priors.smoothness) {
      priors.smoothness->variance_factor = white_factor;
    }
    return priors;
  }

  const Observations& o_;
  GroupedSeries groups_;
  Eigen::MatrixXd K_;
  RowMatrix rows_;  ///< rows [A | residual]
  Eigen::VectorXd scale_;
};

/// -2 log likelihood of the residuals for the best white factor, without constants:
///     (m - rank) log q + log |V| + g . x,   q = sum of squares of the prewhitened residuals
/// m: number of rows, g: derivative of log |A^T V^-1 A| by x.
class Likelihood {
 public:
  Likelihood(const NoiseSeries& series, const Scales& scales, RowMatrix residual, double freedom)
      : series_(series), scales_(scales), residual_(std::move(residual)), freedom_(freedom) {}

  struct Value {
    double objective = 0.0, white_factor = 1.0;
    RowMatrix innovation;  ///< prewhitened residuals
    std::vector<double> log_variance;
  };
  [[nodiscard]] Value at(const Parameters& x) const {
    const NoiseWhitening whitening(series_, scales_.noise(x));
    Value v{.innovation = residual_};
    whitening.apply(v.innovation);
    v.log_variance.assign(whitening.log_variance().begin(), whitening.log_variance().end());
    double q = 0.0;
    for (Eigen::Index i = 0; i < v.innovation.rows(); ++i) {
      q += v.innovation(i, 0) * v.innovation(i, 0);
      v.objective += v.log_variance[static_cast<std::size_t>(i)];
    }
    v.white_factor = q / freedom_;
    v.objective += freedom_ * natural_logarithm(q);
    if (slope_.size() > 0) {
      v.objective += slope_.dot(x);
    }
    return v;
  }

  void set_slope(Eigen::VectorXd slope) { slope_ = std::move(slope); }
  void set_residual(RowMatrix residual) { residual_ = std::move(residual); }

 private:
  const NoiseSeries& series_;
  const Scales& scales_;
  RowMatrix residual_;
  double freedom_;
  Eigen::VectorXd slope_;
};

struct Bounds {
  Parameters low, high;
  [[nodiscard]] Parameters clamped(const Parameters& x) const {
    return x.cwiseMax(low).cwiseMin(high);
  }
};

struct Scored {
  Parameters x;
  Likelihood::Value value;
  Eigen::MatrixXd information;  ///< Fisher information of the parameters x
};

/// Derivative of the objective by x, and Fisher information of x for the best white factor. With
/// the prewhitened residuals e of variance kappa and the log variances l of the predictions,
///     F_jk = sum (dl_j - mean) (dl_k - mean) / 2 + sum de_j de_k / kappa
struct Slope {
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;
};
Slope slope_at(const Likelihood& likelihood, const Parameters& x, const Likelihood::Value& v) {
  constexpr double kStep = 1e-4;  // step of a logarithm
  const Eigen::Index p = x.size(), m = v.innovation.rows();
  Slope s{Eigen::VectorXd::Zero(p), Eigen::MatrixXd::Zero(p, p)};
  Eigen::MatrixXd of_log(m, p), of_residual(m, p);
  for (Eigen::Index k = 0; k < p; ++k) {
    Parameters moved = x;
    moved(k) += kStep;
    const Likelihood::Value w = likelihood.at(moved);
    s.gradient(k) = (w.objective - v.objective) / kStep;
    for (Eigen::Index i = 0; i < m; ++i) {
      const auto at = static_cast<std::size_t>(i);
      of_log(i, k) = (w.log_variance[at] - v.log_variance[at]) / kStep;
      // change of the prediction alone: e sqrt(S) has the variance kappa S
      of_residual(i, k) =
          (w.innovation(i, 0) * (1.0 + 0.5 * kStep * of_log(i, k)) - v.innovation(i, 0)) / kStep;
    }
    of_log.col(k).array() -= of_log.col(k).mean();
  }
  s.information =
      0.5 * (of_log.transpose() * of_log) + of_residual.transpose() * of_residual / v.white_factor;
  return s;
}

/// Minimises the objective by Fisher scoring with damping [Levenberg 1944].
Scored minimised(const Likelihood& likelihood, const Bounds& bounds, Parameters x) {
  constexpr int kMostSteps = 30;
  constexpr double kConverged = 1e-3;  // change of -2 log likelihood
  constexpr double kLongest = 1.5;     // largest step of a logarithm
  Likelihood::Value v = likelihood.at(x);
  Slope s = slope_at(likelihood, x, v);
  double damping = 1e-3;
  for (int step = 0; step < kMostSteps; ++step) {
    Eigen::MatrixXd F = s.information;
    Eigen::VectorXd g = s.gradient;
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      F(k, k) += damping * F(k, k) + 1e-6;
      const bool outwards =
          (x(k) <= bounds.low(k) && g(k) > 0.0) || (x(k) >= bounds.high(k) && g(k) < 0.0);
      if (outwards) {
        F.row(k).setZero();
        F.col(k).setZero();
        F(k, k) = 1.0;
        g(k) = 0.0;
      }
    }
    Eigen::VectorXd by = -0.5 * F.ldlt().solve(g);
    const double expected = -0.5 * g.dot(by);
    if (expected < kConverged) {
      break;
    }
    by *= std::min(1.0, kLongest / by.cwiseAbs().maxCoeff());
    const Parameters moved = bounds.clamped(x + by);
    Likelihood::Value w = likelihood.at(moved);
    if (w.objective < v.objective) {
      x = moved;
      v = std::move(w);
      s = slope_at(likelihood, x, v);
      damping = std::max(1e-3, 0.1 * damping);
    } else {
      damping = std::max(0.1, 10.0 * damping);
      if (damping > 1e6) {
        break;
      }
    }
  }
  return {x, std::move(v), std::move(s.information)};
}

Bounds bounds_for(const NoiseSeries& series, Eigen::Index variances) {
  constexpr double kLeastVariance = 1e-4, kMostVariance = 1e5;
  // Limits of the correlation time. With a shorter time the segments are not correlated. A longer
  // one is a drift, which the rigid unknowns follow.
  constexpr double kShortest = 0.3, kLongest = 0.5;
  Bounds b{Parameters::Constant(variances + 1, natural_logarithm(kLeastVariance)),
           Parameters::Constant(variances + 1, natural_logarithm(kMostVariance))};
  b.low(variances) = natural_logarithm(kShortest * series.segment_duration());
  b.high(variances) =
      std::max(b.low(variances) + 1.0, natural_logarithm(kLongest * series.duration()));
  return b;
}

/// Start values: the best of a few points, with the grouped residuals.
Parameters start(const Likelihood& likelihood, const Bounds& bounds) {
  constexpr std::array kTimes{0.1, 0.25, 0.45, 0.65, 0.85};
  constexpr std::array kVariances{0.3, 3.0, 30.0};
  const Eigen::Index last = bounds.low.size() - 1;
  Parameters best;
  double least = 0.0;
  for (const double share : kTimes) {
    for (const double variance : kVariances) {
      Parameters x = Parameters::Constant(last + 1, natural_logarithm(variance));
      x(last) = bounds.low(last) + share * (bounds.high(last) - bounds.low(last));
      const double objective = likelihood.at(x).objective;
      if (best.size() == 0 || objective < least) {
        best = x;
        least = objective;
      }
    }
  }
  return best;
}

TrackerNoise noise_at(const Scales& scales, const Scored& best) {
  const SlowNoise slow = scales.noise(best.x);
  const double kappa = best.value.white_factor;
  return {.white_factor = kappa,
          .slow_range_m = std::sqrt(kappa * slow.variance[0]),
          .slow_angle_rad = std::sqrt(kappa * slow.variance[1]),
          .slow_along_m = std::sqrt(kappa * slow.variance[3]),
          .correlation_time = slow.correlation_time};
}

/// Residuals y - A U of the rows, divided by their white noise.
RowMatrix without(const Observations& o, std::span<const double> residual_m,
                  const Eigen::VectorXd& U) {
  RowMatrix left(std::ssize(residual_m), 1);
  for (std::size_t i = 0; i < residual_m.size(); ++i) {
    double r_m = residual_m[i];
    for (const SparseRows::Entry& e : o.A.row(i)) {
      r_m -= e.value * U(static_cast<Eigen::Index>(e.column));
    }
    left(static_cast<Eigen::Index>(i), 0) = r_m / o.rows[i].sigma_m;
  }
  return left;
}

}  // namespace

Result<TrackerNoise> estimate_noise(const Observations& o, std::span<const double> residual_m,
                                    const Options& options) {
  // Each round uses U and the derivative of log |A^T V^-1 A| from the end of the previous round.
  // When the rounds no longer change x, the derivative of -2 log of the restricted likelihood is
  // zero. After the second round this derivative hardly changes, and only U is computed again.
  constexpr int kMostRounds = 4, kRoundsWithSlope = 2;
  // Limit of the squared change of x, relative to its variance: a third of the standard deviation.
  // The next round would change x by less than a tenth of this.
  constexpr double kConverged = 0.1;
  const NoiseSeries series = noise_series(o);
  const Scales scales(series);
  const Bounds bounds = bounds_for(series, scales.variances());
  const AboutUnknowns unknowns(o, series, residual_m);
  const std::size_t rank = o.unknowns() - static_cast<std::size_t>(datum_of(o).conditions().rows());
  const auto freedom = [&](std::size_t rows) {
    return static_cast<double>(rows - std::min(rank, rows - 1));
  };

  const RowMatrix residual =
      without(o, residual_m, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(o.unknowns())));
  const GroupedSeries& groups = unknowns.groups();
  const Likelihood of_groups(groups.series, scales, groups.sums(residual),
                             freedom(groups.rows.size()));
  Likelihood likelihood(series, scales, residual, freedom(o.rows.size()));
  Scored best = minimised(likelihood, bounds, start(of_groups, bounds));
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(best.x.size());

  for (int round = 0; round < kMostRounds; ++round) {
    ABBE_TRY(check_stopped(options.stopped));
    const double white_factor = best.value.white_factor;
    const AboutUnknowns::Fit at = unknowns.fit(scales.noise(best.x), white_factor);
    if (round < kRoundsWithSlope) {
      slope = unknowns.slope(at, scales, best.x);
    }
    likelihood.set_slope(slope);
    likelihood.set_residual(without(o, residual_m, at.U));
    const Parameters before = best.x;
    best = minimised(likelihood, bounds, before);
    const Eigen::VectorXd change = best.x - before;
    if (change.dot(best.information * change) < kConverged) {
      break;
    }
  }
  if (!std::isfinite(best.value.objective)) {
    return failure(ErrorCode::NotConverged,
                   "noise of the tracker: its likelihood is not a number: repeat the run");
  }
  return noise_at(scales, best);
}

}  // namespace abbe::calib::otf
