#include "abbe/calib/evemu/judge/lack_of_fit.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "abbe/calib/evemu/solve/prior.hpp"
#include "abbe/calib/geometry/kinematic_chain.hpp"
#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/evemu/judge/touch_residuals.hpp"
#include "abbe/calib/internal/evemu/run/screen.hpp"
#include "abbe/calib/internal/evemu/solve/fit_coefficients.hpp"
#include "abbe/calib/internal/geometry/rigid_free_norm.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"
#include "judge/alternative_columns.hpp"
#include "solve/norm_over_balls.hpp"
#include "solve/refit.hpp"
#include "solve/slow_noise.hpp"

namespace abbe::calib::evemu {
namespace {

/// Probability of a false alarm in a run without a fault, over all alternatives together.
constexpr double kFalseAlarm = 1e-4;
/// Probability of a false alarm for alternatives that change the model by more than kLarge standard
/// uncertainties. In a run without a fault such alternatives are rare; if one is overlooked, the
/// stated uncertainty is wrong.
constexpr double kFalseAlarmIfLarge = 1e-2;
constexpr double kLarge = 2.0;
constexpr double kCauses = 13.0;

double threshold(double family, double false_alarm = kFalseAlarm) {
  return natural_logarithm(kCauses * family / false_alarm);
}

/// The entry for a comparison that failed. The model is then refused, because the alternative may
/// be true.
Alternative not_compared(Cause cause, const std::string& place, const std::string& why) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  return {.cause = cause,
          .text = message("the comparison with cause \"", name(cause), "\"", place,
                          " failed: ", why, "; check the touches there and calibrate again"),
          .bias_m = kNaN,
          .u_m = kNaN,
          .comparison = Comparison::Failed};
}

Alternative impossible(Cause cause, std::string text) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  return {.cause = cause,
          .text = std::move(text),
          .bias_m = kNaN,
          .u_m = kNaN,
          .comparison = Comparison::Impossible};
}

/// Input and results of the comparisons.
struct Comparisons {
  const RunRows& rows;
  const Refit& base;
  const Watch& watch;
  std::vector<Alternative> found{}, not_made{};

  void add(Alternative alternative) {
    (alternative.comparison == Comparison::Made ? found : not_made)
        .push_back(std::move(alternative));
  }
  /// `family`: number of alternatives of the same cause.
  void add_if_significant(Alternative alternative, double family) {
    const bool large = alternative.bias_m > kLarge * rows.norm.rms_u_m(base.covariance_m2);
    if (alternative.log_likelihood > threshold(family, large ? kFalseAlarmIfLarge : kFalseAlarm)) {
      add(std::move(alternative));
    }
  }
};

struct Screened {
  const Added* best = nullptr;
  Screen::Gain gain{0.0, 0.0};
};

/// The most likely alternative of one cause, by the fast estimate of Screen. No alternative if one
/// of them cannot be compared.
Result<Screened> screened(Comparisons& all, const AlternativeColumns& columns, const Screen& screen,
                          std::span<const Added> family) {
  Screened most;
  for (const Added& added : family) {
    ABBE_TRY(check_stopped(all.watch.stopped));
    const Screen::Gain gain = screen.gain(white_rows(all.rows.o, columns.of(added)));
    if (!std::isfinite(gain.log_likelihood)) {
      all.add(
          not_compared(added.cause, where(added, all.rows.o), "its likelihood cannot be computed"));
      return Screened{};
    }
    if (gain.log_likelihood > most.gain.log_likelihood) {
      most = {&added, gain};
    }
  }

  return most;
}

/// `screen` selects the most likely alternative of one cause by a fast estimate; a separate fit
/// then computes the likelihood of this alternative.
Result<void> compare_with(Comparisons& all, const AlternativeColumns& columns, const Screen& screen,
                          std::span<const Added> family) {
  const Result<Screened> best = screened(all, columns, screen, family);
  ABBE_TRY(best);

  if (best->best == nullptr) {
    return {};
  }

  const RunRows& rows = all.rows;
  const Added& added = *best->best;
  const auto with =
      refit(rows, rows.design, rows.X, white_rows(rows.o, columns.of(added)), best->gain.size_m);

  if (!with) {
    all.add(not_compared(added.cause, where(added, rows.o), with.error().text));
    return {};
  }

  all.add_if_significant(
      {.cause = added.cause,
       .text = text_of(added, with->d_m, rows.o),
       .log_likelihood = with->hyper.log_likelihood - all.base.hyper.log_likelihood,
       .bias_m = rows.norm.rms_m(with->c_m - all.base.c_m),
       .u_m = rows.norm.rms_u_m(with->covariance_m2)},
      static_cast<double>(family.size() * Screen::kSizes_m.size()));

  return {};
}

/// Compares the estimate with another design in place of X. `what`: "the order of axes XYZ".
void compare_with_design(Comparisons& all, const Result<ScaledDesign>& design, Cause cause,
                         const std::string& what, std::string text) {
  if (!design) {
    all.add(impossible(cause, message("not compared with ", what, ": ", design.error().text)));
    return;
  }

  const RunRows& rows = all.rows;
  const FitProblem problem = problem_of(rows.o, *design, {});
  const auto with =
      refit(rows, *design, white_rows(rows.o, problem.X), Eigen::MatrixXd(rows.X.rows(), 0), 1.0);

  if (!with) {
    all.add(not_compared(cause, ", " + what + ",", with.error().text));
    return;
  }

  const double gain = with->hyper.log_likelihood - all.base.hyper.log_likelihood;
  constexpr double kDesigns = 6.0;
  if (!(gain > threshold(kDesigns))) {
    return;
  }

  std::vector<Vector3> points;
  Eigen::MatrixXd difference(static_cast<Eigen::Index>(3 * rows.o.rows.size()), 1);
  for (Eigen::Index i = 0; i < std::ssize(rows.o.rows); ++i) {
    const Vector3& q = rows.o.rows[static_cast<std::size_t>(i)].reading_m;
    points.push_back(q);
    difference.middleRows<3>(3 * i) = design->B(q) * with->c_m - rows.design.B(q) * all.base.c_m;
  }

  all.add({.cause = cause,
           .text = std::move(text),
           .log_likelihood = gain,
           .bias_m = RigidFreeNorm(difference, points).rms_m(Eigen::VectorXd::Ones(1)),
           .u_m = norm_over_balls(rows.o, *design).rms_u_m(with->covariance_m2)});
}

std::string letters(const KinematicChain& chain) {
  std::string text;
  for (const Axis a : chain.order_w_to_t()) {
    text += letter(a);
  }
  return text;
}

/// Keeps only the most likely alternative among those from index `from` on.
void keep_the_most_likely(std::vector<Alternative>& found, std::size_t from) {
  const auto first = found.begin() + static_cast<std::ptrdiff_t>(from);
  if (first == found.end()) {
    return;
  }
  std::iter_swap(first, std::max_element(first, found.end(), [](const auto& a, const auto& b) {
                   return a.log_likelihood < b.log_likelihood;
                 }));
  found.erase(first + 1, found.end());
}

Result<void> compare_orders_of_axes(Comparisons& all) {
  const RunRows& rows = all.rows;
  const std::string used = letters(rows.o.machine.chain);
  const std::size_t before = all.found.size();
  std::string order = "XYZ";
  do {
    if (order == used) {
      continue;
    }
    if (Result<void> goes_on = check_stopped(all.watch.stopped); !goes_on) {
      return goes_on;
    }
    const auto design =
        KinematicChain::parse(message("[w b ", order[0], " ", order[1], " ", order[2], " t]"))
            .and_then([&](const KinematicChain& chain) {
              return ScaledDesign::of(chain, rows.o.order, rows.design.box());
            });
    compare_with_design(all, design, Cause::ChainOrder, message("the order of axes ", order),
                        message("the order of the axes from workpiece to tool is ", order, ", not ",
                                used, " as in the machine's chain"));
  } while (std::next_permutation(order.begin(), order.end()));
  keep_the_most_likely(all.found, before);

  return {};
}

Result<void> compare_higher_order(Comparisons& all) {
  const RunRows& rows = all.rows;
  if (Result<void> goes_on = check_stopped(all.watch.stopped); !goes_on) {
    return goes_on;
  }
  compare_with_design(all,
                      ScaledDesign::of(rows.o.machine.chain, rows.o.order + 1, rows.design.box()),
                      Cause::Order, message("polynomials of order ", rows.o.order + 1),
                      message("polynomials of order ", rows.o.order,
                              " do not describe the errors of this machine: order ",
                              rows.o.order + 1, " fits better; set order = ", rows.o.order + 1));
  return {};
}

/// Compares with slow noise, for estimators that do not model it. For bayes-pose solve() has made
/// this comparison.
Result<void> compare_slow_noise(Comparisons& all, const Solution& solution) {
  const RunRows& rows = all.rows;
  if (solution.estimator == Estimator::BayesPose || rows.o.seen.empty()) {
    return {};
  }

  const auto slow = likely_slow_noise(rows.o, rows.design, rows.hyper);
  if (!slow) {
    all.add(not_compared(Cause::SlowNoise, "", slow.error().text));
    return {};
  }

  constexpr double kSizes = 7.0;
  if (!(slow->log_likelihood > threshold(kSizes))) {
    return {};
  }

  const Observations o = with_slow_noise(rows.o, slow->per_s);
  const auto with = run_rows(o, rows.design, solution);
  const auto fit = with.and_then([](const RunRows& r) { return base_refit(r); });

  if (!fit) {
    all.add(not_compared(Cause::SlowNoise, "", fit.error().text));
    return {};
  }

  all.add({.cause = Cause::SlowNoise,
           .text = slow_noise_text(slow->per_s * fit->hyper.s_m),
           .log_likelihood = slow->log_likelihood,
           .bias_m = rows.norm.rms_m(fit->c_m - all.base.c_m),
           .u_m = rows.norm.rms_u_m(fit->covariance_m2)});

  return {};
}

/// The alternative for a finding in the touches. The effect of the finding is subtracted from the
/// observed errors, and the estimate is repeated; the more significant the finding, the better the
/// size of its effect is known. A finding of scatter has no known effect: bias_m stays NaN, and the
/// model is refused.
Alternative compared_touch(const RunRows& rows, const Refit& base, const TouchFinding& f) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  // The size of the effect is never known better than to this fraction, because the real surface
  // differs from the fitted one.
  constexpr double kKnownTo = 0.3;
  Alternative found{f.cause, f.text, f.log_likelihood, kNaN, rows.norm.rms_u_m(base.covariance_m2)};

  if (f.rows_m.size() == 0) {
    return found;
  }

  const Eigen::VectorXd effect = white_rows(rows.o, f.rows_m);
  const double known_to = std::max(kKnownTo, 1.0 / std::sqrt(2.0 * f.log_likelihood));
  const auto with = refit_to(rows.y - effect, rows, rows.design, rows.X, effect, known_to);

  if (!with) {
    found.text += message("; its effect could not be computed: ", with.error().text);
    return found;
  }

  found.bias_m = rows.norm.rms_m(with->c_m - base.c_m);
  found.u_m = rows.norm.rms_u_m(with->covariance_m2);
  return found;
}

Result<void> compare_touches(Comparisons& all, const TouchResiduals& touches) {
  for (const TouchFinding& f : touches.findings) {
    if (Result<void> goes_on = check_stopped(all.watch.stopped); !goes_on) {
      return goes_on;
    }
    all.add(compared_touch(all.rows, all.base, f));
  }

  for (const std::string& place : touches.failed) {
    all.add(not_compared(
        Cause::Touch, ", " + place,
        "no sphere or plane fits its touches after the model's V is removed from them"));
  }

  if (!touches.not_compared.empty()) {
    all.add(impossible(Cause::Touch, touches.not_compared));
  }

  return {};
}

Result<void> compare_all(Comparisons& all, const Solution& solution) {
  const AlternativeColumns columns(all.rows.o);
  const RunRows& rows = all.rows;
  const Screen screen(
      rows.X, rows.S, rows.A, rows.y,
      prior_variances(PriorKind::BayesPose, rows.design, rows.positions, rows.hyper),
      rows.hyper.s_m);
  const std::vector<std::vector<Added>> families = columns.families();
  const double steps = static_cast<double>(families.size()) + 3.0;
  double done = 0.0;

  const auto report = [&] {
    if (all.watch.progress) {
      all.watch.progress(++done / steps);
    }
  };

  for (const std::vector<Added>& family : families) {
    if (Result<void> compared = compare_with(all, columns, screen, family); !compared) {
      return compared;
    }
    report();
  }

  for (const auto& compare : {compare_orders_of_axes, compare_higher_order}) {
    if (Result<void> compared = compare(all); !compared) {
      return compared;
    }
    report();
  }

  Result<void> compared = compare_slow_noise(all, solution);
  report();
  return compared;
}

/// The alternative that the ball centres scatter more than touches and array explain.
std::optional<Alternative> unexplained_scatter(const RunRows& rows, const Refit& base,
                                               const TouchResiduals& touches) {
  constexpr double kSuspicious = 2.0;
  const double s_m = base.hyper.s_m;
  if (!(touches.sigma_m > 0.0) || !(s_m > kSuspicious * touches.s_centre_m)) {
    return std::nullopt;
  }

  const double excess_m = std::sqrt(3.0 * (s_m * s_m - touches.s_centre_m * touches.s_centre_m));
  return Alternative{
      .cause = Cause::Scatter,
      .text = message(
          "ball centres scatter by ", s_m * kUmPerM,
          " um about the model, but the noise of their touches explains only ",
          touches.s_centre_m * kUmPerM, " um: polynomials of order ", rows.o.order,
          " do not describe the errors of this machine (pitch of a screw, a moving load), or the "
          "array is not rigid, or there is slow noise"),
      .log_likelihood = 0.0,
      .bias_m = excess_m,
      .u_m = rows.norm.rms_u_m(base.covariance_m2)};
}

/// The scatter of the touches as an alternative. Noise of the probe averages out in the model;
/// errors of the machine that vary within a ball do not, and touches cannot distinguish them from
/// noise. The effect of backlash that was found is not part of this scatter, because the model is
/// the mean of both directions of approach.
std::optional<Alternative> scatter_of_touches(const CorrectionSize& size,
                                              const TouchResiduals& touches) {
  const double within_m = std::sqrt(3.0) * touches.sigma_of_no_cause_m;
  if (!(within_m > kScatterBesideU * size.u_m)) {
    return std::nullopt;
  }
  return Alternative{
      .cause = Cause::Scatter,
      .text = message("touches scatter by ", touches.sigma_of_no_cause_m * kUmPerM,
                      " um about their balls and blocks: backlash or the pitch of a screw, "
                      "which the model does not follow, or a probe with poor repeatability"),
      .log_likelihood = 0.0,
      .bias_m = within_m,
      .u_m = size.u_m};
}

}  // namespace

std::string_view name(Cause cause) {
  constexpr std::array<std::string_view, 13> kNames{
      "touch", "form",  "backlash",    "ball",  "array-file", "moved",  "creep",
      "bent",  "drift", "chain-order", "order", "slow-noise", "scatter"};
  return kNames[static_cast<std::size_t>(cause)];
}

CorrectionSize correction_size(const Observations& o, const Solution& solution) {
  const PolynomialModel& model = *solution.model.polynomials();
  const RigidFreeNorm norm = norm_over_balls(o, model.design());
  return {norm.rms_m(model.c_m()), norm.rms_u_m(model.covariance_m2())};
}

Result<std::vector<Alternative>> alternatives(const Observations& observations,
                                              const Solution& solution, const Watch& watch) {
  // All alternatives are compared without slow noise: slow noise that is large enough would also
  // fit an array that moved once.
  const Observations o = with_slow_noise(observations, 0.0);
  const Result<ScaledDesign> design = design_of(o);
  ABBE_TRY(design);

  const auto rows = run_rows(o, *design, solution);
  const auto base = rows.and_then([](const RunRows& r) { return base_refit(r); });
  if (!base) {
    return failure(base.error().code,
                   message("lack of fit of the estimate itself: ", base.error().text));
  }

  Comparisons all{*rows, *base, watch};
  const TouchResiduals touches = touch_residuals(o, solution.model, kFalseAlarm / kCauses);
  const Result<void> compared =
      compare_touches(all, touches).and_then([&] { return compare_all(all, solution); });

  ABBE_TRY(compared);

  if (auto scatter = scatter_of_touches(correction_size(observations, solution), touches)) {
    all.add(*std::move(scatter));
  }

  // Alternatives that change the model come first (backlash, for example, can have the highest
  // likelihood but hardly changes the ball centres). Among them a single touch off its surface
  // comes first, because it can be the origin of a displaced ball or of an array that seems to have
  // moved. The rest is sorted by likelihood.
  const auto key = [](const Alternative& a) {
    return std::tuple(!(a.bias_m > kMatters * a.u_m), a.cause != Cause::Touch, -a.log_likelihood);
  };

  std::stable_sort(all.found.begin(), all.found.end(),
                   [&](const Alternative& a, const Alternative& b) { return key(a) < key(b); });
  if (auto scatter = unexplained_scatter(*rows, *base, touches)) {
    all.add(*std::move(scatter));
  }

  std::move(all.not_made.begin(), all.not_made.end(), std::back_inserter(all.found));
  return std::move(all.found);
}

}  // namespace abbe::calib::evemu
