#include "abbe/calib/evemu/lack_of_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "abbe/calib/evemu/artefact_rows.hpp"
#include "abbe/calib/evemu/design_rows.hpp"
#include "elementary.hpp"
#include "evemu/alternative_columns.hpp"
#include "evemu/fit_coefficients.hpp"
#include "evemu/refit.hpp"
#include "evemu/touch_residuals.hpp"
#include "message.hpp"
#include "rigid_free_norm.hpp"
#include "units.hpp"

namespace abbe::calib::evemu {
namespace {

/// Of a false alarm in a run without a fault, over all alternatives together.
constexpr double kFalseAlarm = 1e-4;
constexpr double kCauses = 13.0;
/// Prior standard deviations of a displacement that are tried.
constexpr std::array<double, 4> kSizes_m{10e-6, 30e-6, 100e-6, 300e-6};

RigidFreeNorm norm_over_balls(const Observations& o, const ScaledDesign& design) {
  Eigen::MatrixXd B(static_cast<Eigen::Index>(3 * o.rows.size()), static_cast<Eigen::Index>(design.size()));
  std::vector<Vector3> points;
  for (Eigen::Index i = 0; i < std::ssize(o.rows); ++i) {
    points.push_back(o.rows[static_cast<std::size_t>(i)].reading_m);
    B.middleRows<3>(3 * i) = design.B(points.back());
  }
  return {B, points};
}

/// White rows of a run, and the estimate of bayes-pose without any alternative.
struct Rows {
  const Observations& o;
  const ScaledDesign& design;
  std::size_t positions;
  Eigen::MatrixXd X, S, A;
  Eigen::VectorXd y;
  HyperParameters hyper;
  RigidFreeNorm norm;
};

Result<Rows> rows_of(const Observations& o, const ScaledDesign& design, const Solution& solution) {
  const FitProblem problem = problem_of(o, design, {});
  Rows rows{.o = o,
            .design = design,
            .positions = o.positions(),
            .X = white_rows(o, problem.X),
            .S = white_rows(o, pose_rotation_rows(o)),
            .A = white_rows(o, problem.A),
            .y = white_rows(o, problem.y),
            .hyper = {},
            .norm = norm_over_balls(o, design)};
  if (solution.estimator == Estimator::BayesPose && solution.hyper) {
    rows.hyper = *solution.hyper;
    return rows;
  }
  const auto hyper =
      most_likely(PriorKind::BayesPose, design, rows.positions, LinearGaussian(rows.X, rows.S, rows.y));
  if (!hyper) {
    return tl::unexpected(hyper.error());
  }
  rows.hyper = *hyper;
  return rows;
}

/// Estimate with columns added; those of the array's own uncertainty always are.
struct Refit {
  HyperParameters hyper;
  Eigen::VectorXd c_m, d_m;
  Eigen::MatrixXd covariance_m2;  ///< of c
};

Result<Refit> refit(const Rows& rows, const ScaledDesign& design, const Eigen::MatrixXd& X,
                    const Eigen::MatrixXd& C, double size_m) {
  Eigen::MatrixXd all(X.rows(), X.cols() + rows.A.cols() + C.cols());
  all << X, rows.A, C;
  std::vector<double> added(static_cast<std::size_t>(rows.A.cols()), 1.0);
  added.resize(added.size() + static_cast<std::size_t>(C.cols()), size_m * size_m);
  const LinearGaussian gaussian(all, rows.S, rows.y);
  const auto hyper = most_likely_near(rows.hyper, design, rows.positions, gaussian, added);
  if (!hyper) {
    return tl::unexpected(hyper.error());
  }
  const Eigen::VectorXd prior =
      with_added(prior_variances(PriorKind::BayesPose, design, rows.positions, *hyper), design.size(), added);
  const auto p = gaussian.posterior(prior, hyper->s_m * hyper->s_m);
  const Eigen::Index n = X.cols();
  return Refit{*hyper, p.mean.head(n), p.mean.segment(n + rows.A.cols(), C.cols()),
               p.covariance.topLeftCorner(n, n)};
}

/// Covariance of y at the hyper-parameters of the estimate: what an alternative would make more likely.
class Screen {
 public:
  explicit Screen(const Rows& rows) {
    const HyperParameters& h = rows.hyper;
    const Eigen::VectorXd prior =
        prior_variances(PriorKind::BayesPose, rows.design, rows.positions, h).head(rows.X.cols());
    const Eigen::MatrixXd X = rows.X * prior.cwiseSqrt().asDiagonal();
    Eigen::MatrixXd covariance = h.s_m * h.s_m * Eigen::MatrixXd::Identity(X.rows(), X.rows());
    covariance.noalias() += X * X.transpose() + h.w_rad * h.w_rad * rows.S * rows.S.transpose();
    covariance.noalias() += rows.A * rows.A.transpose();
    llt_.compute(covariance);
    z_ = llt_.matrixL().solve(rows.y);
  }

  struct Gain {
    double log_likelihood = 0.0;
    double size_m = 0.0;
  };
  /// By the best of kSizes_m.
  [[nodiscard]] Gain gain(const Eigen::MatrixXd& C) const {
    const Eigen::MatrixXd G = llt_.matrixL().solve(C);
    const Eigen::MatrixXd GG = G.transpose() * G;
    const Eigen::VectorXd g = G.transpose() * z_;
    Gain best{-1e300, 0.0};
    for (const double size_m : kSizes_m) {
      // log N(y; K + t^2 C C^T) - log N(y; K) = g^T M^-1 g t^2 / 2 - log |M| / 2,  M = 1 + t^2 G^T G
      const double t2 = size_m * size_m;
      const Eigen::LLT<Eigen::MatrixXd> M(Eigen::MatrixXd::Identity(GG.rows(), GG.cols()) + t2 * GG);
      const double log_det = 2.0 * M.matrixLLT().diagonal().unaryExpr(&natural_logarithm).sum();
      const double value = 0.5 * (t2 * g.dot(M.solve(g)) - log_det);
      if (value > best.log_likelihood) {
        best = {value, size_m};
      }
    }
    return best;
  }

 private:
  Eigen::LLT<Eigen::MatrixXd> llt_;
  Eigen::VectorXd z_;
};

/// The estimate itself, with the array's uncertainty among the columns: what alternatives are compared with.
Result<Refit> base_of(const Rows& rows) {
  return refit(rows, rows.design, rows.X, Eigen::MatrixXd(rows.X.rows(), 0), 1.0);
}

double threshold(double family) {
  return natural_logarithm(kCauses * family / kFalseAlarm);
}

/// The best of one cause: from the screen the place, from a fit of its own how likely it is.
Result<std::optional<Alternative>> best_of(const Rows& rows, const Refit& base, const Screen& screen,
                                           std::span<const Added> family) {
  const Added* best = nullptr;
  Screen::Gain most;
  for (const Added& added : family) {
    const Screen::Gain gain = screen.gain(white_rows(rows.o, added.columns));
    if (best == nullptr || gain.log_likelihood > most.log_likelihood) {
      best = &added, most = gain;
    }
  }
  if (best == nullptr || !(most.log_likelihood > 0.0)) {
    return std::nullopt;
  }
  const auto with = refit(rows, rows.design, rows.X, white_rows(rows.o, best->columns), most.size_m);
  if (!with) {
    return std::nullopt;  // no likelihood there
  }
  const double gain = with->hyper.log_likelihood - base.hyper.log_likelihood;
  const double tried = static_cast<double>(family.size() * kSizes_m.size());
  if (!(gain > threshold(tried))) {
    return std::nullopt;
  }
  return Alternative{.cause = best->cause,
                     .text = text_of(*best, with->d_m, rows.o),
                     .log_likelihood = gain,
                     .bias_m = rows.norm.rms_m(with->c_m - base.c_m),
                     .u_m = rows.norm.rms_u_m(with->covariance_m2)};
}

/// The same errors with another design in the place of X.
std::optional<Alternative> other_design(const Rows& rows, const Refit& base,
                                        const Result<ScaledDesign>& design, Cause cause, std::string text) {
  if (!design) {
    return std::nullopt;
  }
  const FitProblem problem = problem_of(rows.o, *design, {});
  const auto with =
      refit(rows, *design, white_rows(rows.o, problem.X), Eigen::MatrixXd(rows.X.rows(), 0), 1.0);
  if (!with || !(with->hyper.log_likelihood - base.hyper.log_likelihood > threshold(6.0))) {
    return std::nullopt;
  }
  std::vector<Vector3> points;
  Eigen::MatrixXd difference(static_cast<Eigen::Index>(3 * rows.o.rows.size()), 1);
  for (Eigen::Index i = 0; i < std::ssize(rows.o.rows); ++i) {
    const Vector3& q = rows.o.rows[static_cast<std::size_t>(i)].reading_m;
    points.push_back(q);
    difference.middleRows<3>(3 * i) = design->B(q) * with->c_m - rows.design.B(q) * base.c_m;
  }
  return Alternative{.cause = cause,
                     .text = std::move(text),
                     .log_likelihood = with->hyper.log_likelihood - base.hyper.log_likelihood,
                     .bias_m = RigidFreeNorm(difference, points).rms_m(Eigen::VectorXd::Ones(1)),
                     .u_m = norm_over_balls(rows.o, *design).rms_u_m(with->covariance_m2)};
}

std::string letters(const KinematicChain& chain) {
  std::string text;
  for (const Axis a : chain.order_w_to_t()) {
    text += letter(a);
  }
  return text;
}

std::optional<Alternative> other_order_of_axes(const Rows& rows, const Refit& base) {
  const std::string used = letters(rows.o.machine.chain);
  std::string order = "XYZ";
  std::optional<Alternative> best;
  do {
    const auto chain = KinematicChain::parse(message("[w b ", order[0], " ", order[1], " ", order[2], " t]"));
    if (order == used || !chain) {
      continue;
    }
    auto found =
        other_design(rows, base, ScaledDesign::of(*chain, rows.o.order, rows.design.box()), Cause::ChainOrder,
                     message("the axes carry each other in the order ", order,
                             " from workpiece to tool, not ", used, " as the machine's chain says"));
    if (found && (!best || found->log_likelihood > best->log_likelihood)) {
      best = std::move(found);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return best;
}

std::optional<Alternative> higher_order(const Rows& rows, const Refit& base) {
  if (rows.o.order >= kMostOrder) {
    return std::nullopt;
  }
  return other_design(rows, base, ScaledDesign::of(rows.o.machine.chain, rows.o.order + 1, rows.design.box()),
                      Cause::Order,
                      message("the errors of this machine are no polynomials of order ", rows.o.order,
                              ": order ", rows.o.order + 1, " fits better; set it as order"));
}

std::vector<Alternative> of_touches(const Rows& rows, const Refit& base, const TouchResiduals& touches) {
  const LinearGaussian gaussian(rows.X, rows.S, rows.y);
  const Eigen::VectorXd prior =
      prior_variances(PriorKind::BayesPose, rows.design, rows.positions, rows.hyper);
  std::vector<Alternative> found;
  for (const TouchFinding& f : touches.findings) {
    // What only scatters has no known effect: NaN, and refuses.
    double bias_m = std::numeric_limits<double>::quiet_NaN();
    if (f.rows_m.size() > 0) {
      const Eigen::MatrixXd dc =
          gaussian.response(prior, rows.hyper.s_m * rows.hyper.s_m, white_rows(rows.o, f.rows_m));
      bias_m = rows.norm.rms_m(dc.col(0).head(rows.X.cols()));
    }
    found.push_back({f.cause, f.text, f.log_likelihood, bias_m, rows.norm.rms_u_m(base.covariance_m2)});
  }
  return found;
}

/// What the balls scatter by beyond touches and array is somewhere in the machine.
std::optional<Alternative> unexplained_scatter(const Rows& rows, const Refit& base,
                                               const TouchResiduals& touches) {
  constexpr double kSuspicious = 2.0;
  const double s_m = base.hyper.s_m;
  if (!(touches.sigma_m > 0.0) || !(s_m > kSuspicious * touches.s_centre_m)) {
    return std::nullopt;
  }
  const double excess_m = std::sqrt(3.0 * (s_m * s_m - touches.s_centre_m * touches.s_centre_m));
  return Alternative{
      .cause = Cause::Scatter,
      .text = message("ball centres scatter by ", s_m * kUmPerM,
                      " um about the model, their touches let them scatter by ", touches.s_centre_m * kUmPerM,
                      " um: the errors of this machine are no polynomials of order ", rows.o.order,
                      " (pitch of a screw, a travelling weight), or the array is not rigid, or slow noise"),
      .log_likelihood = 0.0,
      .bias_m = excess_m,
      .u_m = rows.norm.rms_u_m(base.covariance_m2)};
}

/// A noise of the probe averages out in the model, what the machine has within a ball does not: no touch
/// tells them apart. Twice: then it is larger than the 95 % interval of every point.
std::optional<Alternative> scatter_of_touches(const Rows& rows, const Refit& base,
                                              const TouchResiduals& touches) {
  constexpr double kTwice = 2.0;
  const double u_m = rows.norm.rms_u_m(base.covariance_m2), within_m = std::sqrt(3.0) * touches.sigma_m;
  if (!(within_m > kTwice * u_m)) {
    return std::nullopt;
  }
  return Alternative{.cause = Cause::Scatter,
                     .text = message("touches scatter by ", touches.sigma_m * kUmPerM,
                                     " um about their balls and blocks: backlash or the pitch of a screw, "
                                     "which the model does not follow, or a probe that does not repeat"),
                     .log_likelihood = 0.0,
                     .bias_m = within_m,
                     .u_m = u_m};
}

}  // namespace

std::string_view name(Cause cause) {
  constexpr std::array<std::string_view, 13> kNames{"touch", "form",       "backlash", "ball",  "array-file",
                                                    "moved", "creep",      "bent",     "drift", "chain-order",
                                                    "order", "slow-noise", "scatter"};
  return kNames[static_cast<std::size_t>(cause)];
}

CorrectionSize correction_size(const Observations& o, const Solution& solution) {
  const EvemuModel& model = *solution.model.polynomials();
  const RigidFreeNorm norm = norm_over_balls(o, model.design());
  return {norm.rms_m(model.c_m()), norm.rms_u_m(model.covariance_m2())};
}

Result<std::vector<Alternative>> alternatives(const Observations& o, const Solution& solution) {
  const Result<ScaledDesign> design = design_of(o);
  if (!design) {
    return tl::unexpected(design.error());
  }
  const Result<Rows> rows = rows_of(o, *design, solution);
  if (!rows) {
    return tl::unexpected(rows.error());
  }
  const Result<Refit> base = base_of(*rows);
  if (!base) {
    return tl::unexpected(base.error());
  }
  const TouchResiduals touches = touch_residuals(o, solution.model, kFalseAlarm / kCauses);
  std::vector<Alternative> found = of_touches(*rows, *base, touches);
  const Screen screen(*rows);
  const std::vector<Added> added = alternative_columns(o);
  for (auto from = added.begin(); from != added.end();) {
    const auto to = std::find_if(from, added.end(), [&](const Added& a) { return a.cause != from->cause; });
    auto best = best_of(*rows, *base, screen, {from, to});
    if (!best) {
      return tl::unexpected(best.error());
    }
    if (*best) {
      found.push_back(**std::move(best));
    }
    from = to;
  }
  for (const auto& design_test : {other_order_of_axes, higher_order}) {
    if (auto better = design_test(*rows, *base)) {
      found.push_back(*std::move(better));
    }
  }
  // First what moves the model: backlash is highly significant and leaves the centres where they are.
  constexpr double kMatters = 0.1;
  const auto key = [](const Alternative& a) {
    return std::pair(!(a.bias_m > kMatters * a.u_m), -a.log_likelihood);
  };
  std::stable_sort(found.begin(), found.end(),
                   [&](const Alternative& a, const Alternative& b) { return key(a) < key(b); });
  for (const auto& scatter_test : {scatter_of_touches, unexplained_scatter}) {
    if (auto scatter = scatter_test(*rows, *base, touches)) {
      found.push_back(*std::move(scatter));
    }
  }
  return found;
}

}  // namespace abbe::calib::evemu
