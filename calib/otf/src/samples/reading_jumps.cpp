#include "abbe/calib/internal/otf/samples/reading_jumps.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::otf {
namespace {

/// Distance of each reading of an axis from the line through its neighbours; 0 at both ends.
std::vector<double> off_neighbours_m(std::span<const EncoderReading> readings, Eigen::Index axis) {
  std::vector<double> off_m(readings.size(), 0.0);
  for (std::size_t i = 1; i + 1 < readings.size(); ++i) {
    const EncoderReading &before = readings[i - 1], &here = readings[i], &after = readings[i + 1];
    const double share = (here.time_s - before.time_s) / (after.time_s - before.time_s);
    off_m[i] = here.q_m(axis) - (1.0 - share) * before.q_m(axis) - share * after.q_m(axis);
  }
  return off_m;
}

/// True if both neighbours of reading i deviate by about half as much, to the other side: the
/// reading is a jump and back.
bool returns(const std::vector<double>& off_m, std::size_t i) {
  constexpr double kLeast = 0.3, kMost = 0.7;
  const auto is_half = [&](double neighbour_m) {
    const double share = -neighbour_m / off_m[i];
    return share > kLeast && share < kMost;
  };
  return is_half(off_m[i - 1]) && is_half(off_m[i + 1]);
}

/// Standard deviation of the distances `off_m` before or after a reading, the larger of both. Where
/// the axis starts or stops, only one side contains motion.
double scale_around_m(const std::vector<double>& off_m, std::size_t i) {
  constexpr std::size_t kBeside = 12;
  const auto scale_m = [&](std::size_t begin, std::size_t end) {
    std::vector<double> part_m;
    for (std::size_t k = begin; k < end; ++k) {
      part_m.push_back(std::abs(off_m[k]));
    }
    return kMadToSigma * median(part_m);
  };
  return std::max(scale_m(i - std::min(i, kBeside), i),
                  scale_m(i + 1, std::min(off_m.size(), i + kBeside + 1)));
}

/// Standard deviation of the distance of a reading from the line that is caused by the errors of
/// its time and of its neighbours' times.
double scale_of_times_m(const EncoderLog& log, Eigen::Index axis, std::size_t i) {
  constexpr double kRootOfVariance = 1.2247448713915890;  // sqrt(1.5)
  const EncoderReading &before = log.readings[i - 1], &after = log.readings[i + 1];
  const double v_m_s = (after.q_m(axis) - before.q_m(axis)) / (after.time_s - before.time_s);
  return kRootOfVariance * std::abs(v_m_s) * log.sigma_time_s;
}

void mark_jumps(const EncoderLog& log, Eigen::Index axis, std::vector<bool>& jumps) {
  constexpr double kOff = 7.0, kLeast_m = 2e-6;
  const std::vector<double> off_m = off_neighbours_m(log.readings, axis);
  for (std::size_t i = 1; i + 1 < off_m.size(); ++i) {
    if (std::abs(off_m[i]) > kLeast_m && returns(off_m, i) &&
        std::abs(off_m[i]) >
            kOff * std::max(scale_around_m(off_m, i), scale_of_times_m(log, axis, i))) {
      jumps[i] = true;
    }
  }
}

}  // namespace

WithoutJumps without_jumps(const EncoderLog& log) {
  std::vector<bool> jumps(log.readings.size(), false);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    mark_jumps(log, axis, jumps);
  }

  WithoutJumps found;
  found.jumps = static_cast<std::size_t>(std::count(jumps.begin(), jumps.end(), true));
  if (found.jumps > 0) {
    EncoderLog rest = log;
    rest.readings.clear();
    for (std::size_t i = 0; i < jumps.size(); ++i) {
      if (!jumps[i]) {
        rest.readings.push_back(log.readings[i]);
      }
    }
    found.log = std::move(rest);
  }
  return found;
}

}  // namespace abbe::calib::otf
