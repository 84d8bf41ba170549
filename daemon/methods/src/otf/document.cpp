#include "abbe/methods/otf/document.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abbe/methods/run_figures.hpp"
#include "otf/run_residuals.hpp"

namespace abbe::daemon {

namespace {

ResidualFigures document_figures(const calib::otf::ResidualStatistics& s) {
  return {s.mean_abs_m, s.rms_m, s.max_abs_m};
}

/// The value, or 0 if it is not finite, as for statistics without degrees of freedom.
double or_zero(double value) {
  return std::isfinite(value) ? value : 0.0;
}

ModelStatistics model_statistics(const calib::otf::Solution& solution) {
  const calib::otf::Statistics& s = solution.statistics;
  return {.samples = s.samples,
          .lost_samples = s.lost_samples,
          .observations = s.observations,
          .unknowns = s.unknowns,
          .rank = s.rank,
          .condition = or_zero(s.condition),
          .sigma0 = or_zero(s.sigma0),
          .chi2_per_dof = or_zero(s.chi2_per_dof),
          .variance_factor = s.variance_factor,
          .before = document_figures(s.before),
          .after = document_figures(s.after),
          .iterations = s.iterations,
          .stop_reason = std::string{calib::otf::stop_reason(solution.estimator)},
          .degrees_of_freedom = static_cast<double>(s.degrees_of_freedom)};
}

/// The rms before and after compensation, in equal intervals of the paths of all runs, one after
/// the other.
class RmsAlongPath {
 public:
  explicit RmsAlongPath(std::span<const RunResiduals> runs) {
    double length_m = 0.0;
    for (const RunResiduals& run : runs) {
      begins_m_.push_back(length_m);
      double of_run_m = 0.0;
      for (const auto& r : run) of_run_m = std::max(of_run_m, r.way_m);
      length_m += of_run_m;
    }
    width_m_ = length_m / static_cast<double>(kIntervals);
    for (std::size_t i = 0; i < runs.size(); ++i)
      for (const auto& r : runs[i]) add(begins_m_[i] + r.way_m, r.before_m, r.after_m);
  }

  /// Intervals without residuals are left out.
  [[nodiscard]] std::vector<RunFigures::Interval> intervals() const {
    std::vector<RunFigures::Interval> all;
    for (std::size_t k = 0; k < kIntervals; ++k)
      if (counts_[k] > 0.0)
        all.push_back({(static_cast<double>(k) + 0.5) * width_m_,
                       std::sqrt(before_[k] / counts_[k]), std::sqrt(after_[k] / counts_[k])});
    return all;
  }

 private:
  static constexpr std::size_t kIntervals = 100;

  void add(double way_m, double before_m, double after_m) {
    if (!std::isfinite(before_m) || !std::isfinite(after_m)) return;
    const double at = width_m_ > 0.0 ? std::floor(way_m / width_m_) : 0.0;
    const auto k = static_cast<std::size_t>(std::clamp(at, 0.0, kIntervals - 1.0));
    before_[k] += before_m * before_m;
    after_[k] += after_m * after_m;
    counts_[k] += 1.0;
  }

  std::vector<double> begins_m_;
  double width_m_ = 0.0;
  std::array<double, kIntervals> before_{}, after_{}, counts_{};
};

/// The rows after the last vertex of the path, up to the row before the current one. A leg has
/// thousands of rows, so the rows are not compared with the line to each new row: if the direction
/// of the line changes, the distance of a row from it grows at most by that change times the
/// distance of the row from the vertex.
class SkippedRows {
 public:
  [[nodiscard]] bool empty() const { return rows_m_.empty(); }
  [[nodiscard]] const calib::Vector3& last() const { return rows_m_.back(); }

  void restart_at(const calib::Vector3& vertex_m) {
    vertex_m_ = vertex_m;
    rows_m_.clear();
    compared_ = calib::Vector3::Zero();
    aside_m_ = reach_m_ = 0.0;
  }
  calib::Vector3 restart_at_last() {
    const calib::Vector3 vertex_m = last();
    restart_at(vertex_m);
    return vertex_m;
  }

  /// True if a row is farther than kStraight_m from the line from the vertex through `q_m`.
  [[nodiscard]] bool one_lies_aside(const calib::Vector3& q_m) {
    const calib::Vector3 chord_m = q_m - vertex_m_;
    const double length_m = chord_m.norm();
    if (rows_m_.empty() || length_m == 0.0) return false;
    const calib::Vector3 direction = chord_m / length_m;
    if (aside_m_ + reach_m_ * (direction - compared_).norm() <= kStraight_m) return false;

    compared_ = direction;
    aside_m_ = 0.0;
    for (const calib::Vector3& p_m : rows_m_)
      aside_m_ = std::max(aside_m_, (p_m - vertex_m_).cross(direction).norm());
    return aside_m_ > kStraight_m;
  }

  void add(const calib::Vector3& q_m) {
    const calib::Vector3 from_m = q_m - vertex_m_;
    rows_m_.push_back(q_m);
    reach_m_ = std::max(reach_m_, from_m.norm());
    aside_m_ =
        std::max(aside_m_, compared_.isZero() ? from_m.norm() : from_m.cross(compared_).norm());
  }

 private:
  static constexpr double kStraight_m = 0.5e-3;
  calib::Vector3 vertex_m_ = calib::Vector3::Zero();
  std::vector<calib::Vector3> rows_m_;
  calib::Vector3 compared_ = calib::Vector3::Zero();  ///< direction of the line; zero: none yet
  double aside_m_ = 0.0;                              ///< largest distance of a row from that line
  double reach_m_ = 0.0;                              ///< largest distance of a row from the vertex
};

/// The path of a run: its rows in order, without rows that lie on the straight line between others.
std::vector<calib::Vector3> driven_path(const RunResiduals& run) {
  std::vector<const calib::otf::PlacedResidual*> rows;
  for (const auto& row : run) rows.push_back(&row);
  std::ranges::stable_sort(rows, {}, &calib::otf::PlacedResidual::way_m);

  std::vector<calib::Vector3> path;
  SkippedRows skipped;
  for (const auto* row : rows) {
    const calib::Vector3& q_m = row->axis_position_m;
    if (path.empty()) {
      path.push_back(q_m);
      skipped.restart_at(q_m);
      continue;
    }
    if (skipped.one_lies_aside(q_m)) path.push_back(skipped.restart_at_last());
    skipped.add(q_m);
  }
  if (!skipped.empty()) path.push_back(skipped.last());
  return path;
}

TrackerDriftFigures drift_figures(const calib::otf::TrackerDrift& drift) {
  return {.largest_m = drift.largest_m(),
          .u_repeatability_m = drift.u_repeatability_m,
          .visits = drift.visits};
}

}  // namespace

ModelDocument otf_document(const calib::otf::Solution& solution, calib::otf::Mode mode,
                           const Config& config, std::vector<InputFile> inputs,
                           protocol::UtcTime created) {
  ModelDocument document{solution.model,
                         "otf",
                         std::string{calib::otf::name(solution.estimator)},
                         config.machine.name,
                         machine_hash(config),
                         created,
                         model_statistics(solution),
                         std::move(inputs)};
  document.configuration = config.meaning;
  document.mode = calib::otf::name(mode);
  std::copy_if(solution.backlash.begin(), solution.backlash.end(),
               std::back_inserter(document.backlash), [](const auto& b) { return b.determined; });
  if (solution.drift) document.tracker_drift = drift_figures(*solution.drift);
  if (!config.machine.tracker_place.empty() && solution.offset_in_model)
    document.tracker_place = {config.machine.tracker_place, *solution.offset_in_model};
  return document;
}

ModelDocument otf_document(const OtfCandidate& candidate, const Config& config,
                           std::vector<InputFile> inputs, protocol::UtcTime created) {
  ModelDocument document =
      otf_document(candidate.solution, candidate.mode, config, std::move(inputs), created);
  const bool stands = candidate.mode == calib::otf::Mode::Standstill;
  document.run = run_figures(candidate.verdict, stands ? "positions" : "legs");
  document.run->residuals = RmsAlongPath(candidate.residuals).intervals();
  for (const RunResiduals& run : candidate.residuals)
    document.run->places_m.push_back(driven_path(run));
  add_run_residuals(*document.run, candidate.residuals, document.model.validity(), stands);
  document.run->conditions->temperature_K = candidate.temperature_K;
  return document;
}

}  // namespace abbe::daemon
