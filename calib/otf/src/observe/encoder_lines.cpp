#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/otf/observe/along_rows.hpp"
#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::otf {
namespace {

/// There is a gap between two readings if they are farther apart than this number of periods.
constexpr double kGapPeriods = 3.0;

double median_period_s(std::span<const EncoderReading> readings) {
  std::vector<double> periods_s;
  for (std::size_t i = 1; i < readings.size(); ++i) {
    periods_s.push_back(readings[i].time_s - readings[i - 1].time_s);
  }
  return median(periods_s);
}

/// Least-squares line through the readings, at least two.
EncoderLine line_through(std::span<const EncoderReading> readings, double at_s) {
  const auto n = static_cast<double>(readings.size());
  double mean_s = 0.0;  // relative to at_s
  Vector3 mean_m = Vector3::Zero();
  for (const EncoderReading& r : readings) {
    mean_s += (r.time_s - at_s) / n;
    mean_m += r.q_m / n;
  }

  double squares_s2 = 0.0;
  Vector3 products = Vector3::Zero();
  for (const EncoderReading& r : readings) {
    const double t_s = r.time_s - at_s - mean_s;
    squares_s2 += t_s * t_s;
    products += t_s * (r.q_m - mean_m);
  }

  const Vector3 v = products / squares_s2;
  return {mean_m - mean_s * v, v, 1.0 / n + mean_s * mean_s / squares_s2, 1.0 / squares_s2};
}

}  // namespace

Result<void> check(const EncoderLog& log) {
  if (log.readings.size() < 2) {
    return failure(ErrorCode::BadInput,
                   message("scale readings: ", log.readings.size(), " readings, needs at least 2"));
  }

  if (!(log.sigma_time_s > 0.0) || !std::isfinite(log.sigma_time_s)) {
    return failure(ErrorCode::BadInput, message("scale readings: uncertainty of their times ",
                                                log.sigma_time_s, " s: must be positive"));
  }

  for (std::size_t i = 0; i < log.readings.size(); ++i) {
    const EncoderReading& r = log.readings[i];
    if (!std::isfinite(r.time_s) || !r.q_m.allFinite()) {
      return failure(ErrorCode::NotFinite,
                     message("scale readings: reading ", i, " is not a number"));
    }
    if (i > 0 && !(r.time_s > log.readings[i - 1].time_s)) {
      return failure(ErrorCode::BadInput,
                     message("scale readings: reading ", i, " at ", r.time_s, " s follows ",
                             log.readings[i - 1].time_s, " s, time must ascend"));
    }
  }

  return {};
}

EncoderLines::EncoderLines(std::span<const EncoderReading> readings)
    : readings_(readings.begin(), readings.end()), log_start_s_(readings.front().time_s) {
  for (EncoderReading& r : readings_) {
    r.time_s -= log_start_s_;
  }
  period_s_ = median_period_s(readings_);
}

std::optional<EncoderLine> EncoderLines::between_two(double at_s) const {
  const auto after =
      std::upper_bound(readings_.begin(), readings_.end(), at_s,
                       [](double t_s, const EncoderReading& r) { return t_s < r.time_s; });
  if (after == readings_.begin() || after == readings_.end()) {
    return std::nullopt;
  }
  if (after->time_s - (after - 1)->time_s > kGapPeriods * period_s_) {
    return std::nullopt;
  }
  return line_through(std::span(after - 1, after + 1), at_s);
}

std::optional<EncoderLine> EncoderLines::line(double from_s, double at_s, double to_s) const {
  const auto earlier = [](const EncoderReading& r, double t_s) { return r.time_s < t_s; };
  const auto first = std::lower_bound(readings_.begin(), readings_.end(), from_s, earlier);
  const auto last = std::lower_bound(first, readings_.end(), to_s, earlier);
  const auto found = static_cast<double>(last - first), expected = (to_s - from_s) / period_s_;
  if (expected < 3.0 || found < 2.0) {
    return between_two(at_s);
  }
  if (2.0 * found < expected || at_s < first->time_s - period_s_ ||
      at_s > (last - 1)->time_s + period_s_) {
    return std::nullopt;
  }
  return line_through(std::span(first, last), at_s);
}

}  // namespace abbe::calib::otf
