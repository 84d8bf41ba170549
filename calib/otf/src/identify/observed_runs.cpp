#include "identify/observed_runs.hpp"
#include "abbe/calib/internal/otf/identify/observe_run.hpp"

#include <utility>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/model/tool_span.hpp"
#include "abbe/calib/internal/otf/solve/simultaneous.hpp"
#include "abbe/result/try.hpp"
#include "observe/observe_aligned.hpp"
#include "solve/change_in_u.hpp"
#include "solve/priors.hpp"
#include "solve/run_unknowns.hpp"

namespace abbe::calib::otf {
namespace {

tl::unexpected<Error> error_of_run(std::size_t run, const Error& error) {
  return failure(error.code, message("run ", run + 1, ": ", error.text));
}

Result<TableBasis> basis_of_all_tables(const Machine& machine, TravelDependence backlash) {
  auto tables = TableOptions::all_axes(machine.interpolation);
  tables.travel = backlash;
  return ParameterLayout::all_tables(machine.chain, machine.nodes)
      .and_then([&](ParameterLayout layout) { return TableBasis::of(std::move(layout), tables); });
}

Result<Observations> observe_run(const TargetRun& run, Machine machine, const Noise& noise,
                                 const Options& options, std::vector<SegmentSeries>& series) {
  machine.target_offset_m = run.target_offset_m;
  if (options.mode == Mode::Standstill) {
    return observe(run.samples, machine, run.path, noise, options);
  }
  return aligned_segments(run.samples, machine, run.path, noise, options)
      .and_then([&](AlignedSegments segments) {
        series.push_back(segments.series);
        return observe_with_nests(segments, machine, run.path, noise, options);
      });
}

estimation::Information information_of_runs(std::span<const Observations> runs) {
  return with_priors(rows_information(runs), runs.front());
}

}  // namespace

Result<void> check_targets(std::span<const TargetRun> runs) {
  std::vector<Vector3> offsets_m;
  for (const TargetRun& run : runs) {
    if (!run.target_offset_m.allFinite()) {
      return failure(ErrorCode::NotFinite, "targets: an offset is not a number");
    }
    offsets_m.push_back(run.target_offset_m);
  }

  if (offsets_m.empty() || !tool_span(offsets_m).any) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("targets: the offsets of the ", offsets_m.size(),
                           " runs are on a line; 18 tables need three offsets that are not on a "
                           "line"));
  }
  return {};
}

Result<ObservedRuns> observe_runs(std::span<const TargetRun> runs, const Machine& machine,
                                  const Noise& noise, const Options& options) {
  const Result<TableBasis> basis = basis_of_all_tables(machine, options.backlash);
  ABBE_TRY(basis);

  ObservedRuns all;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Result<Observations> o = observe_run(runs[k], machine, noise, options, all.series);
    if (!o) {
      return error_of_run(k, o.error());
    }
    all.observations.push_back(with_basis(*o, *basis));
    if (options.smoothness) {
      all.observations.back().smoothness = first_smoothness(*options.smoothness);
    }
  }
  return all;
}

std::size_t rows_of_runs(std::span<const Observations> runs) {
  std::size_t rows = 0;
  for (const Observations& o : runs) {
    rows += o.rows.size();
  }
  return rows;
}

estimation::Information rows_information(std::span<const Observations> runs) {
  const RunUnknowns unknowns(runs);
  estimation::Information all(unknowns.size());
  for (std::size_t k = 0; k < runs.size(); ++k) {
    all.add(information_of(runs[k]).data, unknowns.of_run(k));
  }
  return all;
}

estimation::DatumOptions datum_options(std::span<const Observations> runs, const Options& options) {
  return {.weight = options.datum_weight, .label = [runs](std::size_t unknown) {
            return RunUnknowns(runs).label(runs.front(), unknown);
          }};
}

Result<int> linearise_runs(ObservedRuns& runs, const Noise& noise, const Options& options) {
  const RunUnknowns unknowns(runs.observations);
  const estimation::Datum datum = datum_of_runs(runs.observations.front().basis, unknowns.size());
  Eigen::VectorXd at = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(unknowns.size()));

  for (int adjustments = 1; adjustments <= options.max_adjustments; ++adjustments) {
    ABBE_TRY(check_stopped(options.stopped));

    const estimation::Information data = information_of_runs(runs.observations);
    const Result<Eigen::VectorXd> U =
        datum.estimate(data, datum_options(runs.observations, options));
    ABBE_TRY(U);
    if (change_in_u(*U - at, data) < options.adjustment_tolerance) {
      return adjustments;
    }

    for (std::size_t k = 0; k < runs.series.size(); ++k) {
      Observations& o = runs.observations[k];
      o = linearised_at(std::move(o), unknowns.part(*U, k), runs.series[k], noise);
    }
    at = *U;
    at.tail(at.size() - static_cast<Eigen::Index>(unknowns.model())).setZero();
  }

  return failure(ErrorCode::NotConverged,
                 message("common adjustment of ", runs.observations.size(),
                         " runs: no convergence after ", options.max_adjustments,
                         " adjustments; check that paths, points and target offsets belong "
                         "together"));
}

}  // namespace abbe::calib::otf
