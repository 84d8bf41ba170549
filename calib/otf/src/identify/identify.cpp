#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/internal/otf/identify/observe_run.hpp"

#include <utility>

#include "abbe/calib/internal/otf/observe/aligned_segments.hpp"
#include "abbe/calib/internal/otf/solve/prewhitening.hpp"
#include "abbe/calib/internal/otf/solve/simultaneous.hpp"
#include "abbe/result/try.hpp"
#include "identify/synchronised.hpp"
#include "observe/observe_aligned.hpp"

namespace abbe::calib::otf {
namespace {

/// The share of the linearisation in the progress of Stage::Solve.
constexpr double kLinearised = 0.6;

Options after_linearisation(Options options) {
  if (options.progress) {
    options.progress = [report = std::move(options.progress)](Stage stage, double fraction) {
      report(stage,
             stage == Stage::Solve ? kLinearised + (1.0 - kLinearised) * fraction : fraction);
    };
  }
  return options;
}

/// solve() with a prior for smooth tables, if one is requested: the prior is left out where these
/// rows contradict it. For this test the drift and the range offset from the fit without a prior
/// are subtracted.
Result<Solution> solve_smooth(Observations& o, const RowInformation& rows, const Options& options) {
  Result<Solution> solution = solve(o, rows, options);
  if (!o.smoothness || !solution) {
    return solution;
  }

  const bool has_run_effects = o.drift || o.u_range_offset_m > 0.0 || solution->two_axes;
  const RowInformation judged =
      has_run_effects ? information_of(without_run_effects(o, *solution)) : rows;
  const Result<Smoothness> chosen = permitted_smoothness(
      judged.data, o.basis, *options.smoothness, solution->statistics.variance_factor,
      [&](const Smoothness& s) {
        o.smoothness = s;
        solution = solve(o, rows, options);
        return solution.map([](const Solution& with) { return with.statistics.variance_factor; });
      });
  ABBE_TRY(chosen);

  const std::vector<std::string> notes = notes_on(*chosen);
  o.notes.insert(o.notes.end(), notes.begin(), notes.end());
  return solution;
}

Result<Identification> simultaneous(Observations of_alignment, const SegmentSeries& series,
                                    const Noise& noise, const Options& options, AlongRows* along) {
  Result<ObservationsAtSolution> at_solution =
      linearise_at_solution(std::move(of_alignment), series, noise, options, along);
  ABBE_TRY(at_solution);

  Result<Solution> solution =
      solve_smooth(at_solution->observations, at_solution->information,
                   after_linearisation(options))
          .and_then([&](Solution of_rows) {
            return prewhitened(std::move(of_rows), at_solution->observations, options);
          })
          .and_then(
              [&](Solution s) { return with_misfit(std::move(s), at_solution->observations); });
  ABBE_TRY(solution);

  solution->estimator = Estimator::Simultaneous;
  solution->statistics.iterations = at_solution->adjustments;
  return Identification{std::move(at_solution->observations), *std::move(solution)};
}

Result<Identification> two_step(Observations observations, const Options& options) {
  Result<Solution> solution =
      observations.smoothness ? solve_smooth(observations, information_of(observations), options)
                              : solve(observations, options);
  if (solution) {
    solution = with_misfit(*std::move(solution), observations);
  }
  ABBE_TRY(solution);
  return Identification{std::move(observations), *std::move(solution)};
}

Observations with_smoothness(Observations o, const Options& options) {
  if (options.smoothness) {
    o.smoothness = first_smoothness(*options.smoothness);
  }
  return o;
}

/// Adds to an error text the legs that were not used because of backlash, because they may be its
/// cause.
auto naming_unused(const Observations& o) {
  return [unused = note_on_unused(o)](Error error) {
    if (!unused.empty()) {
      error.text += "; " + unused;
    }
    return error;
  };
}

Result<Identification> estimated(Observations across, const SegmentSeries& series,
                                 const Noise& noise, const Options& options, AlongRows* along) {
  if (options.estimator == Estimator::Simultaneous) {
    return simultaneous(std::move(across), series, noise, options, along);
  }
  return two_step(along != nullptr ? along->added_to(across, series, noise) : std::move(across),
                  options);
}

Result<Identification> identify_observed(Observations observations, const SegmentSeries& series,
                                         const Noise& noise, const Options& options) {
  observations = with_smoothness(std::move(observations), options);
  const auto name_unused = naming_unused(observations);
  if (options.encoders != nullptr) {
    return identify_synchronised(observations, series, noise, options,
                                 [&](AlongRows* along) {
                                   return estimated(observations, series, noise, options, along);
                                 })
        .map_error(name_unused);
  }

  return estimated(std::move(observations), series, noise, options, nullptr).map_error(name_unused);
}

}  // namespace

Result<Identification> identify(std::span<const TrackerObservation> samples, const Machine& machine,
                                const Path& path, const Noise& noise, const Options& options) {
  if (options.mode == Mode::Standstill) {
    return observe(samples, machine, path, noise, options).and_then([&](Observations o) {
      const auto name_unused = naming_unused(o);
      return two_step(with_smoothness(std::move(o), options), options).map_error(name_unused);
    });
  }

  Result<AlignedSegments> run = aligned_segments(samples, machine, path, noise, options);
  ABBE_TRY(run);
  return observe_with_nests(*run, machine, path, noise, options).and_then([&](Observations o) {
    return identify_observed(std::move(o), run->series, noise, options);
  });
}

Result<Identification> identify_segments(const SegmentSeries& series, const Machine& machine,
                                         const Path& path, const Noise& noise,
                                         const Options& options) {
  return observe_segments(series, machine, path, noise, options).and_then([&](Observations o) {
    return identify_observed(std::move(o), series, noise, options);
  });
}

}  // namespace abbe::calib::otf
