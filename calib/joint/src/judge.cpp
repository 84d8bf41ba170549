#include "abbe/calib/joint/judge.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/calib/evemu/judge/judge.hpp"
#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/model/certainty.hpp"
#include "abbe/calib/internal/model/plausible_scale.hpp"
#include "abbe/calib/internal/otf/judge/held_out_rows.hpp"
#include "abbe/calib/otf/judge/judge.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::joint {
namespace {

/// A run, and which of its legs must stay in the fit for each fold.
struct FoldedRun {
  const RunOfPart& run;
  std::vector<std::vector<bool>> needed;

  FoldedRun(const RunOfPart& of, std::size_t folds) : run(of) {
    const otf::Observations& o = *of.observations;
    const otf::Observations linear =
        otf::has_linear_tables(o.basis) ? o : otf::with_linear_tables(o);
    for (std::size_t f = 0; f < folds; ++f) {
      needed.push_back(otf::legs_needed(linear, f, folds));
    }
  }
  [[nodiscard]] bool is_held_out(const otf::Observation& row, std::size_t fold) const {
    return row.leg % needed.size() == fold && !needed[fold][row.leg];
  }
  [[nodiscard]] std::vector<std::size_t> held_out_rows(std::size_t fold) const {
    const std::vector<otf::Observation>& all = run.observations->rows;
    std::vector<std::size_t> rows;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (is_held_out(all[i], fold)) {
        rows.push_back(i);
      }
    }
    return rows;
  }
};

/// The observations of the run without the rows of a fold.
otf::Observations without_fold(const FoldedRun& folded, std::size_t fold) {
  const otf::Observations& all = *folded.run.observations;
  otf::Observations rest = all;
  rest.rows.clear();
  rest.A = {};
  for (std::size_t i = 0; i < all.rows.size(); ++i) {
    if (!folded.is_held_out(all.rows[i], fold)) {
      rest.rows.push_back(all.rows[i]);
      rest.A.append(all.A.row(i));
    }
  }
  return rest;
}

/// The model of all parts without the legs of a fold; nullopt if the remaining data do not
/// determine it.
Result<std::optional<VolumetricModel>> model_without_fold(std::span<const Part> parts,
                                                          const std::vector<FoldedRun>& runs,
                                                          const CommonTables& common,
                                                          std::size_t fold,
                                                          const otf::Options& options) {
  otf::Options quiet = options;
  quiet.progress = {};
  std::vector<Part> rest(parts.begin(), parts.end());
  for (const FoldedRun& folded : runs) {
    Part& part = rest[folded.run.part];
    Result<Part> made =
        otf::solve(without_fold(folded, fold), quiet).and_then([&](const otf::Solution& s) {
          // The offset of the ranges was removed from the observations.
          CommonEffects effects = folded.run.effects;
          effects.place.reset();
          return part_of_run(part.name, s.model, common, effects);
        });
    if (!made && made.error().code == ErrorCode::RankDeficient) {
      return std::nullopt;
    }
    if (!made) {
      return failure(made.error().code, message("held-out test without fold ", fold, " of ",
                                                part.name, ": ", made.error().text));
    }
    part = *std::move(made);
  }

  Result<JointModel> joint = joint_model(rest, common);
  if (!joint && joint.error().code == ErrorCode::RankDeficient) {
    return std::nullopt;
  }
  ABBE_TRY(joint);
  return std::move(joint->model);
}

/// True for causes (Verdict::causes) that concern only the model of one part alone.
bool concerns_own_model(std::string_view cause) {
  constexpr std::array<std::string_view, 9> kOwn{"held-out", "nowhere",    "size",
                                                 "slope",    "volume",     "scale-change",
                                                 "growth",   "shape-only", kUncertain};
  return std::find(kOwn.begin(), kOwn.end(), cause) != kOwn.end() ||
         cause == evemu::name(evemu::Cause::Order) || cause == evemu::name(evemu::Cause::Scatter);
}

}  // namespace

Result<HeldOutFigures> held_out(std::span<const Part> parts, std::span<const RunOfPart> of,
                                const CommonTables& common, const VolumetricModel* active,
                                const otf::Options& options) {
  const std::size_t folds = options.held_out_folds;
  std::vector<FoldedRun> runs;
  std::size_t all_rows = 0;
  for (const RunOfPart& run : of) {
    const std::vector<otf::Observation>& rows = run.observations->rows;
    const std::size_t legs = rows.empty() ? 0 : rows.back().leg + 1;
    if (folds < 2 || legs < folds) {
      return failure(ErrorCode::TooFewObservations,
                     message("held-out test: ", parts[run.part].name, " has ", legs, " legs for ",
                             folds, " folds, needs at least 2 folds and one leg per fold"));
    }
    runs.emplace_back(run, folds);
    all_rows += rows.size();
  }
  if (runs.empty()) {
    return failure(ErrorCode::BadInput, "held-out test: no part is a run");
  }

  otf::HeldOutSums sums;
  for (std::size_t f = 0; f < folds; ++f) {
    ABBE_TRY(check_stopped(options.stopped));
    const auto model = model_without_fold(parts, runs, common, f, options);
    ABBE_TRY(model);
    for (std::size_t k = 0; *model && k < runs.size(); ++k) {
      const otf::Observations& o = *runs[k].run.observations;
      const auto predicted_m = [&](std::size_t row) {
        return otf::predicted_by_model(o, row, **model);
      };
      sums.add(o, runs[k].held_out_rows(f), predicted_m, active,
               [](std::size_t, double, double) {});
    }
    if (options.progress) {
      options.progress(otf::Stage::Judge, static_cast<double>(f + 1) / static_cast<double>(folds));
    }
  }

  if (sums.none.rows == 0) {
    return failure(ErrorCode::RankDeficient,
                   message("held-out test: without any one of ", folds,
                           " folds the other legs do not determine the model"));
  }
  return sums.figures(all_rows);
}

Result<Verdict> judge(const JointModel& joint, std::span<const Part> parts,
                      std::span<const RunOfPart> runs, const CommonTables& common,
                      const VolumetricModel* active, const GateLimits& limits,
                      const otf::Options& options) {
  const Result<HeldOutFigures> figures = held_out(parts, runs, common, active, options);
  ABBE_TRY(figures);

  Verdict verdict = decide(joint.model, *figures, limits, active);
  require_plausible_scale(verdict, common_scale_error(joint.model), limits.max_scale_error);
  const otf::CorrectionSize size = otf::correction_size(joint.model);
  require_certainty(verdict, size.V_m, size.u_m);
  verdict.accepted = verdict.reasons.empty();
  return verdict;
}

void add_verdict_of_part(Verdict& verdict, const std::string& part, const Verdict& of_part) {
  for (std::size_t k = 0; k < of_part.reasons.size(); ++k) {
    const std::string text = part + ": " + of_part.reasons[k];
    if (concerns_own_model(of_part.causes[k])) {
      verdict.notes.push_back(text + " (of this part alone)");
    } else {
      verdict.refuse(of_part.causes[k], text);
    }
  }
  for (const std::string& note : of_part.notes) {
    verdict.notes.push_back(part + ": " + note);
  }
  verdict.accepted = verdict.reasons.empty();
}

}  // namespace abbe::calib::joint
