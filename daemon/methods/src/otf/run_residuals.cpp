#include "otf/run_residuals.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abbe/methods/run_figures.hpp"
#include "abbe/report/model_figures.hpp"

namespace abbe::daemon {
namespace {

using calib::otf::PlacedResidual;

/// First and last time of a run, in times of the tracker's clock; nullopt if a row has no time.
std::optional<std::array<double, 2>> times_of(const RunResiduals& run) {
  std::optional<std::array<double, 2>> times;
  for (const PlacedResidual& r : run) {
    if (!r.time_s) return std::nullopt;
    times = times ? std::array{std::min((*times)[0], *r.time_s), std::max((*times)[1], *r.time_s)}
                  : std::array{*r.time_s, *r.time_s};
  }
  return times;
}

/// The residuals of all runs. The times count from the beginning of the first run; each further run
/// begins where the run before it ended.
struct AllRuns {
  std::vector<std::string> part_names;
  std::vector<RunResidual> residuals;
  std::optional<double> duration_s = 0.0;  ///< nullopt without times
};

AllRuns all_runs(std::span<const RunResiduals> runs, std::string_view part_kind) {
  AllRuns all;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const auto times = times_of(runs[k]);
    const std::size_t first_part = all.part_names.size();
    std::size_t legs = 0;
    for (const PlacedResidual& r : runs[k]) {
      legs = std::max(legs, r.leg + 1);
      RunResidual one{.part = first_part + r.leg,
                      .time_s = std::nullopt,
                      .before_m = r.before_m,
                      .after_m = r.after_m,
                      .sigma_m = r.sigma_m};
      if (times && all.duration_s) one.time_s = *all.duration_s + (*r.time_s - (*times)[0]);
      all.residuals.push_back(one);
    }
    for (std::size_t leg = 1; leg <= legs; ++leg)
      all.part_names.push_back(runs.size() == 1
                                   ? fmt::format("{} {}", part_kind, leg)
                                   : fmt::format("run {}, {} {}", k + 1, part_kind, leg));
    all.duration_s = times && all.duration_s
                         ? std::optional(*all.duration_s + (*times)[1] - (*times)[0])
                         : std::nullopt;
  }
  return all;
}

/// Median over the legs of the mean speed between the first and the last row of a leg; nullopt
/// without times.
std::optional<double> feed_m_per_s(std::span<const RunResiduals> runs) {
  std::vector<double> feeds;
  for (const RunResiduals& run : runs) {
    std::map<std::size_t, std::pair<const PlacedResidual*, const PlacedResidual*>> ends;
    for (const PlacedResidual& r : run) {
      if (!r.time_s) continue;
      auto& [first, last] = ends.try_emplace(r.leg, &r, &r).first->second;
      if (*r.time_s < *first->time_s) first = &r;
      if (*r.time_s > *last->time_s) last = &r;
    }
    for (const auto& [leg, end] : ends) {
      const double dt_s = *end.second->time_s - *end.first->time_s;
      if (dt_s > 0.0) feeds.push_back(std::abs(end.second->way_m - end.first->way_m) / dt_s);
    }
  }
  if (feeds.empty()) return std::nullopt;
  const auto middle = feeds.begin() + std::ssize(feeds) / 2;
  std::ranges::nth_element(feeds, middle);
  return *middle;
}

std::vector<LeftError> left_errors(std::span<const RunResiduals> runs) {
  std::vector<LeftError> left;
  for (const RunResiduals& run : runs)
    for (const PlacedResidual& r : run)
      if (r.held_out)
        left.push_back(
            {r.axis_position_m, r.held_out->no_compensation_m, r.held_out->candidate_m, r.sigma_m});
  return left;
}

}  // namespace

void add_run_residuals(RunFigures& figures, std::span<const RunResiduals> runs,
                       const calib::ValidityVolume& volume, bool stands) {
  const std::string_view part_kind = stands ? "position" : "leg";
  const AllRuns all = all_runs(runs, part_kind);
  add_residuals(figures, part_kind, all.part_names, all.residuals);
  figures.held_out_cells = held_out_cells(volume, left_errors(runs));
  RunFigures::Conditions& conditions = figures.conditions.emplace();
  if (!all.residuals.empty()) conditions.duration_s = all.duration_s;
  if (!stands) conditions.feed_m_per_s = feed_m_per_s(runs);
}

}  // namespace abbe::daemon
