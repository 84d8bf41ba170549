#include "abbe/calib/internal/otf/identify/observe_run.hpp"

#include <utility>
#include <vector>

#include "abbe/calib/internal/otf/samples/standstill.hpp"
#include "abbe/calib/internal/otf/standstill/observe_standstills.hpp"
#include "abbe/result/try.hpp"
#include "nests/drift_observations.hpp"
#include "observe/observe_aligned.hpp"
#include "run/progress.hpp"

namespace abbe::calib::otf {
namespace {

/// Observations in standstill mode, without the standstills at nests.
Result<Observations> observe_standing(std::span<const TrackerObservation> samples,
                                      const Machine& machine, const Path& path, const Noise& noise,
                                      const Options& options) {
  report(options, Stage::Observe, 0.0);
  const Result<NestVisits> nests = find_nest_visits(samples, options.nests, noise);
  ABBE_TRY(nests);
  std::vector<TrackerObservation> of_machine(samples.begin(), samples.end());
  for (const std::size_t i : nests->samples) {
    of_machine[i].valid = false;
  }

  Result<Standstills> all = find_standstills(of_machine, options.standstill);
  ABBE_TRY(all);
  all->lost_samples -= nests->samples.size();
  report(options, Stage::Observe, 0.5);
  return observe_standstills(*all, machine, path, noise, options).map([&](Observations o) {
    return with_nest_visits(std::move(o), *nests, times_of(*all), options.nests);
  });
}

}  // namespace

Result<Observations> observe(std::span<const TrackerObservation> samples, const Machine& machine,
                             const Path& path, const Noise& noise, const Options& options) {
  if (options.mode == Mode::Standstill) {
    return observe_standing(samples, machine, path, noise, options);
  }
  return aligned_segments(samples, machine, path, noise, options)
      .and_then([&](AlignedSegments run) {
        return observe_with_nests(run, machine, path, noise, options);
      });
}

Result<Observations> observe_with_nests(const AlignedSegments& run, const Machine& machine,
                                        const Path& path, const Noise& noise,
                                        const Options& options) {
  return observe_aligned(run.series, run.alignment, machine, path, noise, options)
      .map([&](Observations o) {
        return with_nest_visits(std::move(o), run.nests, times_of(run.series), options.nests);
      });
}

}  // namespace abbe::calib::otf
