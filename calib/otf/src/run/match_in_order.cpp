#include "run/match_in_order.hpp"

namespace abbe::calib::otf {
namespace {

enum class Step : unsigned char { Match, LeaveMeasured, LeaveNominal };

}  // namespace

OrderedMatch match_in_order(std::span<const MeasuredPlace> measured,
                            std::span<const Vector3> nominal_m, double tolerance_m) {
  constexpr double kLeftOver = 1.0, kPreference = 0.01;
  const std::size_t m = measured.size(), n = nominal_m.size(), width = n + 1;
  // cost[j]: least cost of the first i measured and the first j nominal points.
  std::vector<double> cost(width), before(width);
  std::vector<Step> step((m + 1) * width, Step::LeaveNominal);
  for (std::size_t j = 0; j <= n; ++j) {
    cost[j] = kLeftOver * static_cast<double>(j);
  }

  for (std::size_t i = 1; i <= m; ++i) {
    before.swap(cost);
    const MeasuredPlace& place = measured[i - 1];
    cost[0] = before[0] + kLeftOver;
    step[i * width] = Step::LeaveMeasured;
    for (std::size_t j = 1; j <= n; ++j) {
      cost[j] = cost[j - 1] + kLeftOver;
      Step best = Step::LeaveNominal;
      if (before[j] + kLeftOver < cost[j]) {
        cost[j] = before[j] + kLeftOver;
        best = Step::LeaveMeasured;
      }
      const double squares = (place.p_m - nominal_m[j - 1]).squaredNorm();
      const double pair = before[j - 1] + squares / (tolerance_m * tolerance_m) +
                          kPreference * (1.0 - place.preference);
      if (squares <= tolerance_m * tolerance_m && pair < cost[j]) {
        cost[j] = pair;
        best = Step::Match;
      }
      step[i * width + j] = best;
    }
  }

  OrderedMatch match{.measured_of = std::vector<std::optional<std::size_t>>(n)};
  for (std::size_t i = m, j = n; i > 0 || j > 0;) {
    switch (step[i * width + j]) {
      case Step::Match:
        match.measured_of[--j] = --i;
        ++match.matched;
        break;
      case Step::LeaveMeasured:
        --i;
        break;
      case Step::LeaveNominal:
        --j;
        break;
    }
  }

  return match;
}

}  // namespace abbe::calib::otf
