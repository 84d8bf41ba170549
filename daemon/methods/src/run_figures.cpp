#include "abbe/methods/run_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace abbe::daemon {
namespace {

bool is_finite(const RunResidual& r) {
  return std::isfinite(r.before_m) && std::isfinite(r.after_m);
}

/// Sums over the residuals of one part, or of neighbouring parts.
class PartSums {
 public:
  void add(const RunResidual& r) {
    ++part_.count;
    part_.before_rms_m += r.before_m * r.before_m;
    part_.after_rms_m += r.after_m * r.after_m;
    part_.after_max_m = std::max(part_.after_max_m, std::abs(r.after_m));
    if (!r.time_s) return;
    const double t = *r.time_s;
    part_.time_s =
        part_.time_s ? std::array{std::min((*part_.time_s)[0], t), std::max((*part_.time_s)[1], t)}
                     : std::array{t, t};
  }
  /// The figures of the part. Requires at least one residual.
  [[nodiscard]] RunFigures::Part part(std::string name) const {
    RunFigures::Part done = part_;
    const auto n = static_cast<double>(part_.count);
    done.name = std::move(name);
    done.before_rms_m = std::sqrt(part_.before_rms_m / n);
    done.after_rms_m = std::sqrt(part_.after_rms_m / n);
    return done;
  }
  [[nodiscard]] bool is_empty() const { return part_.count == 0; }

 private:
  RunFigures::Part part_;  ///< contains sums of squares instead of rms
};

std::vector<RunFigures::Part> parts_of(const std::vector<std::string>& names,
                                       std::span<const RunResidual> residuals) {
  const std::size_t together = (names.size() + kMostParts - 1) / kMostParts;
  if (together == 0) return {};
  std::vector<PartSums> sums((names.size() + together - 1) / together);
  for (const RunResidual& r : residuals)
    if (is_finite(r)) sums.at(r.part / together).add(r);

  std::vector<RunFigures::Part> parts;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    if (sums[i].is_empty()) continue;
    const std::size_t first = i * together, last = std::min(first + together, names.size()) - 1;
    parts.push_back(sums[i].part(
        first == last ? names[first] : fmt::format("{} to {}", names[first], names[last])));
  }
  return parts;
}

using Point = RunFigures::Series::Point;

/// The smallest and the largest point of each of equal intervals, in the order of the series.
std::vector<Point> thinned(const std::vector<Point>& all) {
  constexpr std::size_t kMost = RunFigures::Series::kMostPoints;
  if (all.size() <= kMost) return all;
  constexpr auto kIntervals = static_cast<double>(kMost / 2);
  const double first = all.front().at, length = all.back().at - first;
  const auto interval_of = [&](const Point& p) {
    return length > 0.0 ? std::min(std::floor(kIntervals * (p.at - first) / length), kIntervals - 1)
                        : 0.0;
  };

  std::vector<Point> kept;
  for (auto begin = all.begin(); begin != all.end();) {
    const double interval = interval_of(*begin);
    const auto end =
        std::find_if(begin, all.end(), [&](const Point& p) { return interval_of(p) > interval; });
    auto [a, b] = std::minmax_element(
        begin, end, [](const Point& p, const Point& q) { return p.after_m < q.after_m; });
    if (b < a) std::swap(a, b);
    kept.push_back(*a);
    if (b != a) kept.push_back(*b);
    begin = end;
  }
  return kept;
}

RunFigures::Series series_of(std::span<const RunResidual> residuals) {
  RunFigures::Series series;
  series.over_time =
      std::ranges::all_of(residuals, [](const RunResidual& r) { return r.time_s.has_value(); });
  std::vector<Point> all;
  double number = 0.0;
  for (const RunResidual& r : residuals) {
    number += 1.0;
    if (is_finite(r)) all.push_back({series.over_time ? *r.time_s : number, r.after_m});
  }
  std::ranges::stable_sort(all, {}, &Point::at);
  series.count = all.size();
  series.points = thinned(all);
  return series;
}

/// The counts of residuals by size relative to their uncertainty; empty if an uncertainty is not
/// known.
std::vector<std::size_t> sigma_counts_of(std::span<const RunResidual> residuals) {
  constexpr std::size_t kIntervals = RunFigures::kSigmaIntervals;
  constexpr double kMost = RunFigures::kMostSigmas;
  std::vector<std::size_t> counts(kIntervals, 0);
  for (const RunResidual& r : residuals) {
    if (!is_finite(r)) continue;
    if (!(r.sigma_m > 0.0) || !std::isfinite(r.sigma_m)) return {};
    const double share = 0.5 * (r.after_m / r.sigma_m / kMost + 1.0);
    const double at = std::clamp(std::floor(share * kIntervals), 0.0, kIntervals - 1.0);
    ++counts[static_cast<std::size_t>(at)];
  }
  return counts;
}

}  // namespace

RunFigures run_figures(const calib::Verdict& verdict, std::string_view held_out) {
  // Without a held-out test the figures are not finite; model.json then contains 0.
  const auto or_none = [](double rms_m) { return std::isfinite(rms_m) ? rms_m : 0.0; };
  return {.held_out = std::string(held_out),
          .held_out_before_m = or_none(verdict.held_out.no_compensation_rms_m),
          .held_out_after_m = or_none(verdict.held_out.candidate_rms_m),
          .notes = {},  // the notes are in ModelDocument::verdict
          .residuals = {}};
}

void add_residuals(RunFigures& run, std::string_view part_kind,
                   const std::vector<std::string>& part_names,
                   std::span<const RunResidual> residuals) {
  run.parts = parts_of(part_names, residuals);
  if (run.parts.empty()) return;
  run.part_kind = part_kind;
  run.series = series_of(residuals);
  run.sigma_counts = sigma_counts_of(residuals);
}

}  // namespace abbe::daemon
