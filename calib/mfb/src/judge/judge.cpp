#include "abbe/calib/mfb/judge/judge.hpp"

#include <optional>
#include <string>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/result/try.hpp"
#include "observe/bar_temperature.hpp"

namespace abbe::calib::mfb {
namespace {

/// Adds chi-square, with its likely cause, as the first reason.
void judge_chi_square(Verdict& verdict, const Identification& found) {
  const Statistics& s = found.solution.statistics;
  if (found.cause.cause != Cause::None) {
    verdict.refuse(name(found.cause.cause), found.cause.text, 0);
  } else if (s.chi2_per_dof > s.chi2_per_dof_limit) {
    verdict.refuse(name(Cause::Unknown),
                   message("chi-square per degree of freedom is ", s.chi2_per_dof, ", at most ",
                           s.chi2_per_dof_limit),
                   0);
  }
}

void note_set_aside(Verdict& verdict, const Identification& found) {
  for (const SetAsideTouch& touch : found.set_aside) {
    verdict.notes.push_back(message(touch.measurement_name, ": ", name(touch.target),
                                    " is excluded: it is ", kUmPerM * touch.residual_m,
                                    " um off its feature"));
  }
}

/// Adds a note if the residuals are much smaller than the stated noise. Chi-square and outliers are
/// then tested with too large limits.
void note_small_residuals(Verdict& verdict, const Statistics& s) {
  constexpr double kSmall = 0.5;
  if (s.degrees_of_freedom > 0.0 && s.chi2_per_dof < kSmall) {
    verdict.notes.push_back(message("chi-square per degree of freedom is ", s.chi2_per_dof,
                                    ": the stated noise of probe and machine is too large, and "
                                    "faults of single touches are not seen"));
  }
}

/// Refuses the model if more touches are excluded than single outliers explain.
void judge_set_aside(Verdict& verdict, const Identification& found) {
  constexpr double kMostSetAside = 0.005;
  std::size_t touches = found.set_aside.size();
  for (const PassObservation& pass : found.observations.passes) {
    touches += pass.touched.size();
  }
  if (!found.unresolved_features.empty()) {
    verdict.refuse("outliers", message(found.unresolved_features.front(),
                                       ": the touches do not fit together: touch it again (one of ",
                                       found.unresolved_features.size(), " such features)"));
  }
  if (static_cast<double>(found.set_aside.size()) > kMostSetAside * static_cast<double>(touches)) {
    verdict.refuse("outliers", message(found.set_aside.size(), " of ", touches,
                                       " touches are excluded, at most ", 100 * kMostSetAside,
                                       " %: look for dirt, a loose stylus or false triggers"));
  }
}

/// Refuses a temperature of the bar that is not plausible, unless it is accepted by name.
void judge_temperature(Verdict& verdict, const std::optional<std::string>& seen,
                       std::string_view name, bool accepted) {
  if (!seen) {
    return;
  }
  if (accepted) {
    verdict.notes.push_back(message(*seen, ", explicitly accepted"));
  } else {
    verdict.refuse(
        name,
        message(*seen, "; check temperature_C, in degrees Celsius; if it is right, accept ", name));
  }
}

void note_scale(Verdict& verdict, const Bar& bar) {
  const std::string per_K = bar.expansion
                                ? message(1e6 * bar.expansion->alpha_per_K, " um/m")
                                : "its expansion, which bar.toml does not state (steel: 11.5 um/m)";
  verdict.notes.push_back(
      message("the scale of the model is that of the bar: an error of 1 um/m of its calibration "
              "changes all lengths by 1 um/m, an error of 1 K of its temperature by ",
              per_K));
}

}  // namespace

Result<Verdict> judge(const Identification& found, const VolumetricModel* active,
                      const JudgeOptions& options) {
  const Result<HeldOutFigures> figures =
      held_out(found.observations, found.solution, active, options.solve);
  ABBE_TRY(figures);
  Verdict verdict = decide(found.model, *figures, options.limits, active);
  judge_chi_square(verdict, found);
  judge_set_aside(verdict, found);
  judge_temperature(verdict, bar_far_from_reference(found.observations), kBarTemperature,
                    options.accept_bar_temperature);
  judge_temperature(verdict, bar_unlike_neighbours(found.observations), kBarTemperatureChange,
                    options.accept_bar_temperature_change);
  note_scale(verdict, found.observations.bar);
  note_set_aside(verdict, found);
  note_small_residuals(verdict, found.solution.statistics);
  verdict.notes.insert(verdict.notes.end(), found.notes.begin(), found.notes.end());
  if (options.solve.estimator == Estimator::Sequential) {
    verdict.notes.emplace_back(
        "held-out test of the estimator \"sequential\": the tables are not estimated again without "
        "the held-out points, so that the test is not independent of them");
  }
  verdict.accepted = verdict.reasons.empty();
  return verdict;
}

}  // namespace abbe::calib::mfb
