#include "abbe/calib/evemu/judge/judge.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string_view>
#include <utility>

#include "abbe/calib/evemu/judge/lack_of_fit.hpp"
#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/evemu/solve/design_rows.hpp"
#include "abbe/calib/internal/evemu/solve/fit_coefficients.hpp"
#include "abbe/calib/internal/model/certainty.hpp"
#include "abbe/calib/internal/model/misfit_in_V.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "abbe/result/try.hpp"
#include "solve/slow_noise.hpp"

namespace abbe::calib::evemu {
namespace {

/// The observations of one position, or of all other positions.
Observations part_of(const Observations& o, int position, bool others) {
  Observations part = o;
  std::erase_if(part.rows, [&](const BallError& r) { return (r.position == position) == others; });
  std::erase_if(part.seen,
                [&](const TouchedArtefact& s) { return (s.position == position) == others; });
  return part;
}

/// V of a compared model at the balls of a position, relative to Ball1 of the position.
Eigen::VectorXd relative_to_ball1(const Observations& position,
                                  const std::function<Vector3(const Vector3&)>& V_at) {
  const Vector3 V1 = V_at(position.rows[position_rows(position).front().ball1].reading_m);
  Eigen::VectorXd V(static_cast<Eigen::Index>(3 * position.rows.size()));
  for (std::size_t i = 0; i < position.rows.size(); ++i) {
    V.segment<3>(static_cast<Eigen::Index>(3 * i)) = V_at(position.rows[i].reading_m) - V1;
  }
  return V;
}

/// A Watch for one part of a computation: its progress 0 to 1 is reported as `low` to `high`.
Watch part_of(const Watch& watch, double low, double high) {
  Watch part{.stopped = watch.stopped};
  if (watch.progress) {
    part.progress = [whole = watch.progress, low, high](double fraction) {
      whole(low + (high - low) * fraction);
    };
  }
  return part;
}

/// Sums, over all positions, of the squared residuals of a model after the best-fit rotation of
/// each position.
struct Remainder {
  double whitened_squares = 0.0;
  double squares_m2 = 0.0;
  std::size_t components = 0;  ///< without those of Ball1, which is not an observation

  void add(const Observations& position, const Eigen::VectorXd& r) {
    const Eigen::MatrixXd S = pose_rotation_rows(position);
    const Eigen::MatrixXd S_white = whitened(position, S);
    const Eigen::VectorXd r_white = whitened(position, r);
    const Eigen::Vector3d omega = S_white.colPivHouseholderQr().solve(r_white);
    whitened_squares += (r_white - S_white * omega).squaredNorm();
    squares_m2 += (r - S * omega).squaredNorm();
    components += 3 * (position.rows.size() - 1);
  }
  [[nodiscard]] double rms() const {
    return std::sqrt(whitened_squares / static_cast<double>(components));
  }
  [[nodiscard]] double rms_m() const {
    return std::sqrt(squares_m2 / static_cast<double>(components));
  }
};

/// The balls of a position inside the validity volume of a model. nullopt if Ball1 is outside,
/// because V is relative to Ball1, or if no other ball is inside.
std::optional<Observations> inside(const Observations& position, const ValidityVolume& volume) {
  if (!volume.contains(position.rows[position_rows(position).front().ball1].reading_m)) {
    return std::nullopt;
  }
  Observations part = position;
  part.seen.clear();
  std::erase_if(part.rows, [&](const BallError& r) { return !volume.contains(r.reading_m); });
  return part.rows.size() > 1 ? std::optional{std::move(part)} : std::nullopt;
}

void note_artefact(const Observations& o, Verdict& verdict) {
  if (!o.artefact) {
    verdict.notes.emplace_back(
        "the artefact's own uncertainty and temperature are not in the covariance");
    return;
  }
  if (o.artefact->none()) {
    verdict.notes.emplace_back("the calibrator states no uncertainty: the array counts as exact");
  }
  if (!o.artefact->expansion) {
    verdict.notes.emplace_back("the array counts as at 20 C");
  }
}

/// Largest accepted error of a model in units of its stated uncertainty. The model is refused if it
/// has a larger error when an alternative is true.
constexpr double kCoveredByU = 1.25;

/// True if the uncertainty of the model covers the effect of the alternative. False for NaN.
bool is_covered(const Alternative& other, const CorrectionSize& size) {
  if (other.cause == Cause::Scatter) {  // u already includes the scatter as white noise
    const bool of_a_probe = other.bias_m <= std::sqrt(3.0) * kScatterOfProbes_m;
    return other.bias_m <= kMostUncertainty * size.V_m &&
           (of_a_probe || other.bias_m <= kScatterBesideU * size.u_m);
  }
  return other.bias_m <= other.u_m &&
         root_sum_of_squares(other.bias_m, other.u_m) <= kCoveredByU * size.u_m;
}

/// True for the causes scatter, form and uncertainty, which are only consequences: every other
/// cause increases the scatter of the touches and the uncertainty.
bool is_consequence(std::string_view cause) {
  return cause == name(Cause::Scatter) || cause == name(Cause::Form) || cause == kUncertain;
}

bool is_cause(const Alternative& a) {
  return a.comparison == Comparison::Made && !is_consequence(name(a.cause));
}

bool refuses(const Alternative& a, const CorrectionSize& size) {
  return a.comparison != Comparison::Impossible && !is_covered(a, size);
}

/// The kinds of reasons for which a run is refused.
struct RefusedFor {
  bool cause = false, form = false, scatter_or_uncertainty = false;
};

RefusedFor refused_for(const Verdict& verdict, const std::vector<Alternative>& others,
                       const CorrectionSize& size) {
  RefusedFor refused;
  refused.scatter_or_uncertainty =
      std::find(verdict.causes.begin(), verdict.causes.end(), kUncertain) != verdict.causes.end();
  for (const Alternative& a : others) {
    if (refuses(a, size)) {
      refused.cause |= is_cause(a);
      refused.form |= a.cause == Cause::Form;
      refused.scatter_or_uncertainty |= a.cause == Cause::Scatter;
    }
  }
  return refused;
}

/// True if the alternative, which by itself does not refuse the model because the uncertainty
/// covers its effect, may be the origin of a refusal for uncertainty, scatter or form: it may have
/// enlarged the uncertainty or the scatter. Only causes that act while a ball is touched can change
/// the form of the ball.
bool may_be_origin(const RefusedFor& refused, const Alternative& a, const CorrectionSize& size) {
  if (refused.cause || !is_cause(a)) {
    return false;
  }
  constexpr double kMuchSmallerU = 0.7;  // ratio of u: the cause explains half of the variance
  const bool matters = a.bias_m > kMatters * size.u_m || a.u_m < kMuchSmallerU * size.u_m;
  const bool in_time = a.cause == Cause::Touch || a.cause == Cause::Moved ||
                       a.cause == Cause::Creep || a.cause == Cause::Drift ||
                       a.cause == Cause::SlowNoise;
  return matters && (refused.scatter_or_uncertainty || (refused.form && in_time));
}

/// Adds the alternatives that refuse the model to the reasons, all others to the notes. Causes come
/// before reasons that are only consequences.
void add_alternatives(Verdict& verdict, std::vector<Alternative> others,
                      const CorrectionSize& size) {
  const RefusedFor refused = refused_for(verdict, others, size);
  std::stable_partition(others.begin(), others.end(), is_cause);
  std::size_t reasons = 0;

  for (const Alternative& other : others) {
    const std::string text = other.cause == Cause::Scatter
                                 ? other.text
                                 : with_effect(other.text, other.bias_m, size.u_m);
    if (refuses(other, size) || may_be_origin(refused, other, size)) {
      verdict.refuse(name(other.cause), text, reasons++);
    } else {
      verdict.notes.push_back(text);
    }
  }
}

/// If the covariance of the estimate includes slow noise, reports it: as a reason before the first
/// reason that is only a consequence, or as a note if there is no such reason.
void add_slow_noise(Verdict& verdict, const Solution& solution) {
  if (!(solution.slow_noise > 0.0)) {
    return;
  }
  const std::string text =
      slow_noise_text(solution.statistics.slow_noise_m) + "; it is included in the uncertainty";
  const auto first = std::find_if(verdict.causes.begin(), verdict.causes.end(), is_consequence);
  if (first == verdict.causes.end()) {
    verdict.notes.push_back(text);
  } else {
    verdict.refuse(name(Cause::SlowNoise), text,
                   static_cast<std::size_t>(first - verdict.causes.begin()));
  }
}

void note_misfit(Verdict& verdict, const Solution& solution) {
  const Misfit* misfit = solution.model.misfit();
  if (misfit == nullptr) {
    return;
  }
  const double u_m = misfit->u_V_m.norm() / std::sqrt(3.0);
  verdict.notes.push_back(message(
      "the ball centres scatter about the model by ", kUmPerM * solution.statistics.s_m,
      " um; touches and array do not explain ", kUmPerM * u_m,
      " um of it in each direction: errors of the machine that polynomials of this order do not "
      "follow (pitch of a screw, guideways), which are in the uncertainty, or the array is not "
      "rigid"));
}

/// Largest distance of a ball from Ball1.
double extent_m(const Observations& o) {
  double most_m = 0.0;
  for (const BallError& row : o.rows) {
    most_m = std::max(most_m, (row.reading_m - o.ball1_m).norm());
  }
  return most_m;
}

/// Notes on errors that touches cannot detect.
void note_what_touches_do_not_show(Verdict& verdict, const Observations& o, double extent_m) {
  constexpr double kSteel_per_K = 11.5e-6;
  verdict.notes.push_back(message(
      "all lengths come from the array: 1 K of wrong temperature of a steel array is an error of ",
      1e6 * kSteel_per_K * extent_m, " um over ", extent_m, " m, 1 um/m of its calibration ",
      extent_m, " um; touches cannot show it"));
  verdict.notes.push_back(message("valid for the tool offset (",
                                  o.machine.tool_offset_m.transpose(),
                                  ") m of the configuration; touches cannot check it"));
}

}  // namespace

Result<HeldOutFigures> held_out(const Observations& o, double s_m, const VolumetricModel* active,
                                const SolveOptions& options, const Watch& watch) {
  const std::vector<PositionRows> positions = position_rows(o);
  constexpr std::size_t kLeastPositions = 3;
  if (positions.size() < kLeastPositions) {
    return failure(ErrorCode::TooFewObservations, message("held-out test: ", positions.size(),
                                                          " positions, needs ", kLeastPositions));
  }

  const Result<ScaledDesign> design = design_of(o);
  ABBE_TRY(design);

  const bool with_active = active != nullptr && active->holds_for_tool(o.machine.tool_offset_m);
  Remainder none, candidate, other, candidate_beside;
  for (const PositionRows& p : positions) {
    ABBE_TRY(check_stopped(watch.stopped));
    const Observations rest = part_of(o, p.position, true),
                       left_out = part_of(o, p.position, false);
    const Result<Fit> fit = fit_with(problem_of(rest, *design, options), options);
    if (!fit) {
      return failure(fit.error().code, message("held-out test without position ", p.position, ": ",
                                               fit.error().text));
    }
    const Eigen::VectorXd y = observed_m(left_out);
    none.add(left_out, y);
    const auto by_fit = [&](const Vector3& q) -> Vector3 { return design->B(q) * fit->c_m; };
    candidate.add(left_out, y - relative_to_ball1(left_out, by_fit));
    if (watch.progress) {
      watch.progress(static_cast<double>(&p - positions.data() + 1) /
                     static_cast<double>(positions.size()));
    }
    if (!with_active) {
      continue;
    }
    if (const auto both = inside(left_out, active->validity())) {
      const Eigen::VectorXd y_both = observed_m(*both);
      candidate_beside.add(*both, y_both - relative_to_ball1(*both, by_fit));
      other.add(*both, y_both - relative_to_ball1(*both, [&](const Vector3& q) {
                         return active->V_at(q, o.machine.tool_offset_m);
                       }));
    }
  }

  HeldOutFigures figures{.no_compensation = none.rms() / s_m,
                         .candidate = candidate.rms() / s_m,
                         .observations = none.components,
                         .no_compensation_rms_m = none.rms_m(),
                         .candidate_rms_m = candidate.rms_m()};

  if (other.components > 0) {
    figures.active = other.rms() / s_m;
    figures.active_rms_m = other.rms_m();
    figures.candidate_beside_active = candidate_beside.rms() / s_m;
    figures.observations_beside_active = other.components;
  }

  return figures;
}

Result<Verdict> judge(const Observations& observations, const Solution& solution,
                      const VolumetricModel* active, const JudgeOptions& options) {
  const Observations o = with_slow_noise(observations, solution.slow_noise);
  SolveOptions solve = options.solve;
  solve.estimator = solution.estimator;
  solve.sparse.chosen = solution.sparse;
  solve.sparse.bootstrap_runs = 0;
  const Result<std::vector<Alternative>> others =
      alternatives(o, solution, part_of(options.watch, 0.0, 0.5));

  ABBE_TRY(others);

  const Watch second_half = part_of(options.watch, 0.5, 1.0);
  return held_out(o, solution.statistics.s_m, active, solve, second_half)
      .map([&](const HeldOutFigures& figures) {
        Verdict verdict = decide(solution.model, figures, options.limits, active);
        if (!solution.rotation.referenced && !options.accept_shape_only) {
          const double u_rad = std::sqrt(solution.rotation.cov_rad2.trace() / 3.0);
          verdict.refuse(
              kShapeOnly,
              message("shape only: the machine measured the blocks itself, so a rotation of about ",
                      1e6 * u_rad,
                      " urad about Ball1 is unknown; provide a rotation reference or accept ",
                      kShapeOnly));
        }
        const CorrectionSize size = correction_size(o, solution);
        const double of_misfit_m =
            std::sqrt(mean_misfit_m2(solution.model, solution.model.validity().vertices_m()));
        require_certainty(verdict, size.V_m, root_sum_of_squares(size.u_m, of_misfit_m));
        note_misfit(verdict, solution);
        add_alternatives(verdict, *others, size);
        add_slow_noise(verdict, solution);
        note_artefact(o, verdict);
        note_what_touches_do_not_show(verdict, o, extent_m(o));
        if (const auto& fit = solution.rotation.rotation_reference; fit && !fit->outside.empty()) {
          verdict.notes.push_back(
              message("rotation reference: ", fit->outside.size(), " of ",
                      fit->outside.size() + fit->points,
                      " points lie outside the volume the balls span and were not used"));
        }
        if (const auto& fit = solution.rotation.rotation_reference; fit && fit->widened > 1.0) {
          verdict.notes.push_back(
              message("rotation reference: chi-square ", fit->widened,
                      " per degree of freedom; the rotation's uncertainty is enlarged for it"));
        }
        verdict.accepted = verdict.reasons.empty();
        return verdict;
      });
}

}  // namespace abbe::calib::evemu
