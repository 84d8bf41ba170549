#include "identify/synchronised.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/otf/observe/row_residuals.hpp"
#include "abbe/calib/internal/otf/samples/reading_jumps.hpp"
#include "abbe/calib/internal/statistics/median.hpp"
#include "abbe/result/try.hpp"
#include "observe/clock_match.hpp"

namespace abbe::calib::otf {
namespace {

bool is_along(const Observation& row) {
  return row.component == kAlong;
}

/// Noise of the rows of one kind (along or across the travel) relative to their uncertainties.
struct NoiseOfRows {
  std::size_t rows = 0;
  double degrees_of_freedom = 0.0;
  ResidualNoise noise;
};

/// Degrees of freedom of the rows: their number minus the part of the unknowns that they determine,
/// trace(Q A^T W^2 A).
double freedom(const Identification& id, bool along, std::size_t rows) {
  const RowInformation information = information_of(
      id.observations, [&](const Observation& row) { return is_along(row) == along; });
  const Eigen::MatrixXd R = information.data.R();
  const double share = (R * id.solution.adjustment.cofactor_Q).cwiseProduct(R).sum();
  return std::max(1.0, static_cast<double>(rows) - share);
}

NoiseOfRows noise_along(const Identification& id) {
  const Observations& o = id.observations;
  NoiseOfRows of;
  of.rows = static_cast<std::size_t>(std::count_if(o.rows.begin(), o.rows.end(), is_along));
  of.degrees_of_freedom = freedom(id, true, of.rows);
  of.noise = residual_noise(o, id.solution.residuals.after_m,
                            static_cast<std::size_t>(of.degrees_of_freedom), kAlong);
  return of;
}

/// Variance of the rows across the travel, relative to the stated variance; at least 1.
double variance_across(const Identification& id) {
  const Observations& o = id.observations;
  const auto rows = o.rows.size() -
                    static_cast<std::size_t>(std::count_if(o.rows.begin(), o.rows.end(), is_along));
  const std::vector<double>& r = id.solution.residuals.after_m;
  double sum = 0.0;
  for (std::size_t i = 0; i < r.size(); ++i) {
    const double w = is_along(o.rows[i]) ? 0.0 : r[i] / o.rows[i].sigma_m;
    sum += w * w;
  }
  return std::max(1.0, sum / freedom(id, false, rows));
}

Result<Identification> without_along(const std::string& why,
                                     const std::function<Result<Identification>(AlongRows*)>& by) {
  Result<Identification> id = by(nullptr);
  if (id) {
    id->observations.notes.push_back("the scale readings were not used along the path: " + why);
  }
  return id;
}

/// Outliers: segments whose row along the travel deviates by seven standard deviations, while the
/// rows of most neighbouring segments do not. (A longer deviation is a fault of the readings and
/// not an outlier.) Empty if more than 5 % of the rows deviate.
std::vector<std::size_t> segments_off(const Identification& id) {
  constexpr double kOff = 7.0, kMostShare = 0.05;
  constexpr std::size_t kLongest = 3;
  const Observations& o = id.observations;
  std::vector<std::size_t> segments;
  std::vector<double> times;  // in units of the standard deviation
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (is_along(o.rows[i])) {
      segments.push_back(o.rows[i].segment);
      times.push_back(std::abs(id.solution.residuals.after_m[i]) / o.rows[i].sigma_m);
    }
  }
  std::vector<double> sorted = times;
  const double limit = kOff * std::max(1.0, kMadToSigma * median(sorted));

  std::vector<std::size_t> off;
  for (std::size_t begin = 0, end = 0; begin < times.size(); begin = end + 1) {
    for (end = begin; end < times.size() && times[end] > limit; ++end) {
    }
    if (end - begin <= kLongest) {
      off.insert(off.end(), segments.begin() + static_cast<std::ptrdiff_t>(begin),
                 segments.begin() + static_cast<std::ptrdiff_t>(end));
    }
  }
  const bool few =
      static_cast<double>(off.size()) <= kMostShare * static_cast<double>(times.size());
  return few ? off : std::vector<std::size_t>{};
}

void add_notes(Observations& o, const AlongRows& along, std::size_t jumps, std::size_t readings) {
  if (jumps > 0) {
    o.notes.push_back(message("scale readings: ", jumps, " of ", readings,
                              " jump away from their neighbours and back, and were not used; check "
                              "scales, cables and the recording"));
  }
  if (!along.left_out().empty()) {
    o.notes.push_back(
        message("scale readings: ", along.left_out().size(),
                " segments do not fit along the travel (seven standard deviations), and "
                "this component of them was not used"));
  }
  if (along.sigma_factor() > 1.0) {
    o.notes.push_back(message("scale readings: their residuals along the path are ",
                              along.sigma_factor(),
                              " times as large as stated; they were used with this uncertainty"));
  }
}

Synchronisation synchronisation_of(const Identification& id, const EncoderLog& log,
                                   const AlongRows& along, const NoiseOfRows& noise) {
  const double factor2 = along.sigma_factor() * along.sigma_factor();
  RunClock clock = along.clock();
  Synchronisation s{.clock = log.known_clock.value_or(clock.map()),
                    .rows = noise.rows,
                    .chi2_per_dof = factor2 * noise.noise.sigma0 * noise.noise.sigma0,
                    .sigma_factor = along.sigma_factor()};
  if (id.solution.clock.size() > 0) {
    const auto at = static_cast<Eigen::Index>(id.observations.clock_offset());
    clock.lag_s += id.solution.clock(0);
    clock.drift += id.solution.clock(1);
    s.clock = clock.map();
    s.u_offset_s = std::sqrt(id.solution.covariance_with_rigid(at, at));
    s.u_drift = std::sqrt(id.solution.covariance_with_rigid(at + 1, at + 1));
  }
  return s;
}

/// Estimates with a corrected clock. A linear adjustment corrects the clock once; then the log is
/// interpolated at the corrected time, and the adjustment is repeated.
Result<Identification> at_corrected_clock(
    AlongRows& along, const Options& options,
    const std::function<Result<Identification>(AlongRows*)>& estimate) {
  constexpr int kRepeats = 2;
  Result<Identification> id = estimate(&along);
  for (int i = 0; options.estimator == Estimator::TwoStep && id && i < kRepeats; ++i) {
    along.correct_clock(id->solution.clock);
    id = estimate(&along);
  }
  return id;
}

}  // namespace

Result<Identification> identify_synchronised(
    const Observations& across, const SegmentSeries& series, const Noise& noise,
    const Options& options, const std::function<Result<Identification>(AlongRows*)>& estimate) {
  ABBE_TRY(check(*options.encoders));
  if (!(series.period_s > 0.0)) {
    return failure(ErrorCode::BadInput,
                   "scale readings: the segments of the tracker have no times");
  }
  const WithoutJumps kept = without_jumps(*options.encoders);
  const EncoderLog& log = kept.log ? *kept.log : *options.encoders;
  const Result<RunClock> clock = match_clocks(log, across, series);
  ABBE_TRY(clock);

  AlongRows along(log, *clock);
  constexpr std::size_t kFewestRows = 30;  // fewer rows are not enough to estimate their own noise
  const Observations first = along.added_to(across, series, noise);
  const std::size_t rows = first.rows.size() - across.rows.size();
  if (rows < kFewestRows) {
    return without_along(
        message("only ", rows, " segments have readings at constant speed, needs ", kFewestRows),
        estimate);
  }

  constexpr double kNormal999 = 3.090, kUnusable = 10.0;
  constexpr int kRounds = 8;
  for (int round = 1;; ++round) {
    Result<Identification> id = at_corrected_clock(along, options, estimate);
    if (!id && id.error().code == ErrorCode::RankDeficient) {
      return without_along(id.error().text, estimate);
    }
    if (!id) {
      return id;
    }

    if (const std::vector<std::size_t> off = segments_off(*id); !off.empty() && round < kRounds) {
      along.leave_out(off);
      continue;
    }

    const NoiseOfRows noise_of = noise_along(*id);
    const double excess = noise_of.noise.sigma0 * noise_of.noise.sigma0 / variance_across(*id);
    const double unsuspicious = 1.0 + kNormal999 * std::sqrt(2.0 / noise_of.degrees_of_freedom);
    if (excess <= unsuspicious || round == kRounds) {
      id->solution.synchronisation = synchronisation_of(*id, log, along, noise_of);
      add_notes(id->observations, along, kept.jumps, options.encoders->readings.size());
      return id;
    }

    along.multiply_sigma(std::sqrt(excess));
    if (along.sigma_factor() > kUnusable) {
      return without_along(message("their residuals are more than ", along.sigma_factor(),
                                   " times as large as stated (limit ", kUnusable, ")"),
                           estimate);
    }
  }
}

}  // namespace abbe::calib::otf
