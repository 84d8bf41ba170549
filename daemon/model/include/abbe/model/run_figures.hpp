#pragma once
/// Figures of the run from which a model was identified, for the report. They are stored in
/// model.json, so that the report can be made again at any time; the hash of the model does not
/// cover them. Every part may be absent, because models of earlier versions have fewer parts.

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

/// Residuals of the fit in the order of the run. A series of more than kMostPoints residuals is
/// divided into intervals, of which the smallest and the largest residual are kept.
struct ResidualSeries {
  static constexpr std::size_t kMostPoints = 2000;
  struct Point {
    /// s from the beginning of the run, or the number of the residual, counted from 1
    double at = 0.0;
    double after_m = 0.0;
    friend bool operator==(const Point&, const Point&) = default;
  };
  std::size_t count = 0;  ///< number of all residuals
  bool over_time = false;
  std::vector<Point> points;
  friend bool operator==(const ResidualSeries&, const ResidualSeries&) = default;
};

struct RunConditions {
  /// lowest and highest temperature during the run
  std::optional<std::array<double, 2>> temperature_K{};
  /// Lowest and highest temperature of a bar, as used in its measurements.
  std::optional<std::array<double, 2>> bar_temperature_K{};
  std::optional<double> duration_s{};
  std::optional<double> feed_m_per_s{};  ///< feed, median over the legs
  /// Dates of the first and last observation; nullopt: the observations have no date, as in files.
  std::optional<std::array<protocol::UtcTime, 2>> measured{};
  friend bool operator==(const RunConditions&, const RunConditions&) = default;
};

struct RunFigures {
  using Series = ResidualSeries;
  using Conditions = RunConditions;
  /// rms of the residuals in one interval of the path.
  struct Interval {
    double at_m = 0.0;  ///< path length from the beginning to the middle of the interval
    double before_m = 0.0, after_m = 0.0;
    friend bool operator==(const Interval&, const Interval&) = default;
  };
  /// Residuals of one part of the run: a leg, a position of the artefact, a measurement.
  struct Part {
    std::string name;
    std::size_t count = 0;  ///< number of residuals; a vector counts as three
    double before_rms_m = 0.0, after_rms_m = 0.0, after_max_m = 0.0;  ///< max: of absolute values
    /// First and last time, from the beginning of the run; nullopt: there are no times.
    std::optional<std::array<double, 2>> time_s{};
    friend bool operator==(const Part&, const Part&) = default;
  };
  /// rms of observations to which the model was not fitted, in one cell of the map of the volume.
  struct HeldOutCell {
    /// numbers of the slab and of the cell in it, see report/model_figures.hpp
    std::size_t slab = 0, cell = 0;
    std::size_t count = 0;
    double before_m = 0.0, after_m = 0.0, sigma_m = 0.0;
    friend bool operator==(const HeldOutCell&, const HeldOutCell&) = default;
  };
  /// A table that only one method has, as text for people.
  struct Table {
    std::string title, explanation;
    std::vector<std::string> columns;
    std::vector<std::vector<std::string>> rows;
    friend bool operator==(const Table&, const Table&) = default;
  };
  /// Counts of residuals / standard uncertainty in equal intervals from -kMostSigmas to
  /// kMostSigmas; larger values are in the outer intervals.
  static constexpr double kMostSigmas = 5.0;
  static constexpr std::size_t kSigmaIntervals = 40;

  /// observations that were excluded from the fit: "legs", "positions", "points"
  std::string held_out;
  double held_out_before_m = 0.0, held_out_after_m = 0.0;  ///< rms
  /// Notes of the verdict, only in models of earlier versions; else see ModelVerdict::notes.
  std::vector<std::string> notes;
  std::vector<Interval> residuals;  ///< for a run along a path, else empty
  /// The places of the measurement, as polylines of scale readings: the path of each run, the balls
  /// of each position of an array, the bar in each of its positions.
  std::vector<std::vector<calib::Vector3>> places_m{};
  std::string part_kind{};  ///< "leg", "position", "measurement"
  std::vector<Part> parts{};
  std::optional<Series> series{};
  std::vector<std::size_t> sigma_counts{};  ///< kSigmaIntervals elements, or none
  std::vector<HeldOutCell> held_out_cells{};
  std::vector<Table> tables{};
  std::optional<Conditions> conditions{};
  /// Set if the model fitted to the run was only used to update this model: the id of the fitted
  /// model. Residuals, held-out test and statistics are then those of the fitted model.
  std::string of_model{};
  friend bool operator==(const RunFigures&, const RunFigures&) = default;
};

}  // namespace abbe::daemon
