#include "observe/bar_temperature.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include "abbe/calib/environment/thermal_expansion.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"

namespace abbe::calib::mfb {
namespace {

constexpr double kReference_C = 20.0;

double celsius(double temperature_K) {
  return kReference_C + temperature_K - kReferenceTemperature_K;
}

/// Text such as ": all lengths change by 562 um/m"; empty if the bar states no expansion.
std::string effect_on_lengths(const Bar& bar, std::string_view lengths, double off_K) {
  return bar.expansion ? message(": ", lengths, " lengths change by ",
                                 kUmPerM * bar.expansion->alpha_per_K * off_K, " um/m")
                       : std::string();
}

/// The first pass of each position, in the order of time.
std::vector<const PassObservation*> first_passes(const Observations& o) {
  std::vector<const PassObservation*> first;
  for (const PassObservation& pass : o.passes) {
    if (first.empty() || first.back()->position != pass.position) {
      first.push_back(&pass);
    }
  }
  return first;
}

/// The smaller of two differences of the same sign; 0 if their signs differ.
double common_K(double a_K, double b_K) {
  return a_K * b_K > 0.0 ? std::copysign(std::min(std::abs(a_K), std::abs(b_K)), a_K) : 0.0;
}

/// Difference of the temperature at position i from both positions next to it (at the ends: from
/// the next two positions, if these agree). It is 0 if a bar warms up steadily or is warmer from
/// one position on, because it then differs on one side only.
double unlike_neighbours_K(const std::vector<const PassObservation*>& passes, std::size_t i,
                           double most_K) {
  const auto at_K = [&](std::size_t k) { return passes[k]->temperature_K; };
  const std::size_t last = passes.size() - 1;
  const bool end = i == 0 || i == last;
  const std::size_t one = i == 0 ? 1 : i - 1, other = i == 0 ? 2 : i == last ? i - 2 : i + 1;
  if (end && std::abs(at_K(one) - at_K(other)) > most_K) {
    return 0.0;
  }
  return common_K(at_K(i) - at_K(one), at_K(i) - at_K(other));
}

}  // namespace

std::optional<std::string> bar_far_from_reference(const Observations& o) {
  const auto from_reference_K = [](const PassObservation& pass) {
    return std::abs(pass.temperature_K - kReferenceTemperature_K);
  };
  const auto worst = std::ranges::max_element(o.passes, {}, from_reference_K);
  if (worst == o.passes.end() || from_reference_K(*worst) <= kMostFromReference_K) {
    return std::nullopt;
  }
  const double off_K = worst->temperature_K - kReferenceTemperature_K;
  return message(o.plan.measurements[worst->measurement].name, ": the temperature of the bar is ",
                 celsius(worst->temperature_K), " C, ", std::abs(off_K),
                 " K from that of its calibration", effect_on_lengths(o.bar, "all", off_K));
}

std::optional<std::string> bar_unlike_neighbours(const Observations& o) {
  const std::vector<const PassObservation*> passes = first_passes(o);
  constexpr double kSureOfTemperature = 3.0;
  const double most_K = kMostBetweenPositions_K + kSureOfTemperature * o.plan.noise.u_temperature_K;
  std::size_t worst = 0;
  double worst_K = 0.0;
  for (std::size_t i = 0; passes.size() > 2 && i < passes.size(); ++i) {
    const double off_K = unlike_neighbours_K(passes, i, most_K);
    if (std::abs(off_K) > std::abs(worst_K)) {
      worst = i;
      worst_K = off_K;
    }
  }
  if (!o.bar.expansion || std::abs(worst_K) <= most_K) {
    return std::nullopt;
  }
  return message(o.plan.measurements[passes[worst]->measurement].name,
                 ": the temperature of the bar is ", celsius(passes[worst]->temperature_K), " C, ",
                 std::abs(worst_K), " K from that of the positions next to it",
                 effect_on_lengths(o.bar, "its", worst_K));
}

}  // namespace abbe::calib::mfb
