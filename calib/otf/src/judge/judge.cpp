#include "abbe/calib/otf/judge/judge.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/model/certainty.hpp"
#include "abbe/calib/internal/model/plausible_scale.hpp"
#include "abbe/calib/internal/statistics/quantile_999.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/observe/orientation.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::otf {
namespace {

/// Inserts the alternatives that refuse the model before the other reasons, because these may be
/// only consequences of the alternatives.
void add_alternatives(Verdict& verdict, const std::vector<Alternative>& others,
                      const std::string& run) {
  std::size_t reasons = 0;
  for (const Alternative& other : others) {
    const std::string text = run + with_effect(other.text, other.bias_m, other.u_m);
    if (other.cause == Cause::CorrelatedNoise) {
      verdict.notes.push_back(run + other.text);
    } else if (other.bias_m <= other.u_m) {
      verdict.notes.push_back(text);
    } else {  // the effect is larger than u, or NaN
      verdict.refuse(name(other.cause), text, reasons++);
    }
  }
}

/// Note if the residuals are larger than the stated noise of the tracker.
void note_chi_square(Verdict& verdict, const Statistics& s, const std::string& run) {
  const auto dof = static_cast<double>(s.degrees_of_freedom);
  const double limit = chi2_per_dof_999(dof);
  if (s.chi2_per_dof > limit) {
    verdict.notes.push_back(message(
        run, "chi-square per degree of freedom is ", s.chi2_per_dof, ", at most ", limit,
        " with the stated noise: the noise is larger than stated, or the machine has errors that "
        "the model does not contain; the uncertainty is that of the residuals"));
  }
}

/// Notes on scale errors, which residuals do not show.
void note_what_u_leaves_out(Verdict& verdict, const Observations& o) {
  const std::vector<Vector3> at = tensor_grid(o.layout().nodes());
  Vector3 centre = Vector3::Zero();
  for (const Vector3& q : at) {
    centre += q / static_cast<double>(at.size());
  }

  double squares = 0.0;
  for (const Vector3& q : at) {
    squares += (q - centre).squaredNorm();
  }

  const double lever_m = std::sqrt(squares / static_cast<double>(at.size()));
  constexpr double kSteel_per_K = 11.5e-6;
  verdict.notes.push_back(
      o.u_scale > 0.0
          ? message("the scale of the model is that of the tracker's ranges, of which u contains ",
                    two_digits(1e6 * o.u_scale),
                    " um/m; 1 um/m, or 1 K of wrong temperature of the ", "air, would be ",
                    two_digits(lever_m), " um rms; residuals do not show it")
          : message("not in the uncertainty: the scale of the tracker's ranges; 1 um/m would be ",
                    two_digits(lever_m), " um rms"));

  if (*std::max_element(o.u_axis_scale.begin(), o.u_axis_scale.end()) <= 0.0) {
    verdict.notes.push_back(
        message("not in the uncertainty: the temperature of the machine's scales; 1 K of steel "
                "would be ",
                two_digits(1e6 * kSteel_per_K * lever_m), " um rms"));
  }
}

/// Note if the data hardly determine the offset of the ranges, because the model can reproduce it;
/// the prior then determines the estimate.
void note_undetermined_offset(Verdict& verdict, const RangeOffset& offset, double prior_m,
                              const std::string& run) {
  const double share = offset.u_m / prior_m;  // 1: the data contain no information
  constexpr double kOfEqualWeight = 0.7;      // 1/sqrt(2): data and prior have equal weight
  if (!(prior_m > 0.0) || !(share > kOfEqualWeight)) {
    return;
  }
  const double u_of_data_m = offset.u_m / std::sqrt(std::max(1e-12, 1.0 - share * share));
  constexpr double kNormal99 = 2.576;
  verdict.notes.push_back(message(
      run,
      "the run hardly determines the offset of the tracker's ranges: its stated uncertainty is ",
      1e6 * prior_m, " um, and an offset below ",
      1e6 * kNormal99 * root_sum_of_squares(u_of_data_m, prior_m), " um would not be detected"));
}

void note_set_aside(Verdict& verdict, const Observations& o, const std::string& run) {
  if (!o.set_aside.any()) {
    return;
  }

  const std::string found = run + set_aside_text(o.set_aside);
  const auto of_samples = static_cast<double>(o.set_aside.of_samples);
  if (static_cast<double>(o.set_aside.samples()) > kMostSetAside * of_samples) {
    verdict.refuse("outliers", message(found, ", limit ", 100.0 * kMostSetAside, " %"));
  } else {
    verdict.notes.push_back(found);
  }
}

void note_drift(Verdict& verdict, const Observations& o, const Solution& solution,
                const std::string& run) {
  if (!solution.drift) {
    return;
  }
  for (const std::string& note : solution.drift->notes) {
    verdict.notes.push_back(run + note);
  }

  constexpr double kNoticedWalk_m = 1e-6;
  if (solution.drift->walk_m > kNoticedWalk_m) {
    verdict.notes.push_back(message(
        run, "the drift of the tracker is not smooth: it contains a random walk of ",
        1e6 * solution.drift->walk_m,
        " um over the run, which the nests show incompletely; the uncertainty contains it: let the "
        "tracker warm up, keep draught from its beam"));
  }

  constexpr double kSlightlyLarger = 1.2;
  const double stated_m = o.drift->u_repeatability_m, used_m = solution.drift->u_repeatability_m;
  if (used_m > kSlightlyLarger * stated_m) {
    verdict.notes.push_back(message(run, "reference nests: their visits scatter more than stated; ",
                                    "they were used with a repeatability of ", 1e6 * used_m,
                                    " um instead of ", 1e6 * stated_m, " um"));
  }
}

}  // namespace

Result<Verdict> judge(const Observations& measured, const Solution& solution,
                      const VolumetricModel* active, const GateLimits& limits,
                      const Options& options, const HeldOutRow& row) {
  return judge(std::span(&measured, 1), std::span(&solution, 1), active, limits, options, row);
}

Result<Verdict> judge(std::span<const Observations> measured, std::span<const Solution> solutions,
                      const VolumetricModel* active, const GateLimits& limits,
                      const Options& options, const HeldOutRow& row) {
  const Tables tables = measured.size() > 1 ? Tables::OfSeveralRuns : Tables::OfThisRun;
  std::vector<Observations> runs;
  std::vector<std::vector<Alternative>> others;
  for (std::size_t k = 0; k < measured.size(); ++k) {
    runs.push_back(without_run_effects(measured[k], solutions[k]));
    Result<std::vector<Alternative>> of_run =
        alternatives(runs.back(), solutions[k], options, tables);
    ABBE_TRY(of_run);
    others.push_back(*std::move(of_run));
  }

  const Result<HeldOutFigures> figures = held_out(runs, active, options, row, solutions);
  ABBE_TRY(figures);

  const Solution& solution = solutions.front();
  Verdict verdict = decide(solution.model, *figures, limits, active);
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const std::string run = runs.size() == 1 ? "" : message("run ", k + 1, ": ");
    for (const std::string& note : runs[k].notes) {
      verdict.notes.push_back(run + note);
    }
    note_chi_square(verdict, solutions[k].statistics, run);
    note_drift(verdict, runs[k], solutions[k], run);
    add_alternatives(verdict, others[k], run);
    note_set_aside(verdict, runs[k], run);
  }
  require_plausible_scale(verdict, common_scale_error(solution.model), limits.max_scale_error);

  // The evidence is that of the first run. The runs have common tables: a later run with a rotated
  // path contradicts them.
  const Observations& first = runs.front();
  require_orientation(verdict, {first.vertices_m}, first.layout().nodes(), first.target_offset_m,
                      first.alignment.T_machine_tracker, options.orientation);
  const CorrectionSize size = correction_size(solution.model);
  require_certainty(verdict, size.V_m, size.u_m);
  note_what_u_leaves_out(verdict, runs.front());
  for (std::size_t k = 0; k < runs.size(); ++k) {
    note_undetermined_offset(verdict, solutions[k].range_offset, runs[k].u_range_offset_m,
                             runs.size() == 1 ? "" : message("run ", k + 1, ": "));
  }
  for (std::string& note : notes_on(solution.backlash)) {
    verdict.notes.push_back(std::move(note));
  }
  verdict.accepted = verdict.reasons.empty();

  return verdict;
}

}  // namespace abbe::calib::otf
