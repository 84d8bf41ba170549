#include "abbe/calib/direct/readings_off.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::direct {
namespace {

constexpr std::size_t kFewestPositions = 5;
constexpr double kMostScales = 20.0, kMostSteps = 5.0, kFileResolution = 1e-7;
constexpr double kSameValue = 1e-12, kCoarsest = 1e-5;  // rounding; resolution of a dial gauge

/// Indices of the readings of one direction of one run, by ascending position.
using Pass = std::vector<std::size_t>;

std::vector<Pass> passes_of(const MeasuredError& error) {
  std::map<std::pair<int, bool>, Pass> passes;
  for (std::size_t i = 0; i < error.readings.size(); ++i) {
    passes[{error.readings[i].run, error.readings[i].forward}].push_back(i);
  }
  std::vector<Pass> out;
  for (auto& [key, pass] : passes) {
    std::stable_sort(pass.begin(), pass.end(), [&](std::size_t a, std::size_t b) {
      return error.readings[a].position_m < error.readings[b].position_m;
    });
    if (pass.size() >= kFewestPositions) {
      out.push_back(std::move(pass));
    }
  }
  return out;
}

/// Value of reading `at` minus the straight line through the readings `a` and `b`.
double off_line(const MeasuredError& error, std::size_t at, std::size_t a, std::size_t b) {
  const Reading &p = error.readings[at], &from = error.readings[a], &to = error.readings[b];
  const double share = (p.position_m - from.position_m) / (to.position_m - from.position_m);
  return p.value - ((1.0 - share) * from.value + share * to.value);
}

/// Curvature of each reading; the key is the index of the reading.
using Curvatures = std::map<std::size_t, double>;

Curvatures curvatures_of(const MeasuredError& error, const std::vector<Pass>& passes) {
  Curvatures all;
  for (const Pass& pass : passes) {
    for (std::size_t k = 0; k < pass.size(); ++k) {
      const std::size_t last = pass.size() - 1;
      const std::size_t a = k == 0 ? 1 : k - 1;
      const std::size_t b = k == 0 ? 2 : k == last ? k - 2 : k + 1;
      all[pass[k]] = off_line(error, pass[k], pass[a], pass[b]);
    }
  }
  return all;
}

/// d of every reading: the curvature minus its median over the passes at the same target.
Curvatures deviations_of(const MeasuredError& error, const std::vector<Pass>& passes) {
  constexpr std::size_t kFewestPasses = 3;
  Curvatures d = curvatures_of(error, passes);
  if (passes.size() < kFewestPasses) {
    return d;
  }
  const auto target = [&](std::size_t reading) {
    return std::llround(error.readings[reading].position_m / kSameTarget_m);
  };
  std::map<long long, std::vector<double>> at_target;
  for (const auto& [reading, curvature] : d) {
    at_target[target(reading)].push_back(curvature);
  }
  for (auto& [reading, curvature] : d) {
    std::vector<double> values = at_target[target(reading)];
    if (values.size() >= kFewestPasses) {
      curvature -= median(values);
    }
  }
  return d;
}

/// Smallest difference of two values that is more than rounding. 0 if it is larger than the
/// resolution of any instrument (kCoarsest).
double resolution_of(const MeasuredError& error) {
  std::vector<double> values;
  for (const Reading& reading : error.readings) {
    values.push_back(reading.value);
  }
  std::sort(values.begin(), values.end());
  double least = 0.0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double step = values[i] - values[i - 1];
    if (step > kSameValue && (least == 0.0 || step < least)) {
      least = step;
    }
  }
  return least <= kCoarsest ? least : 0.0;
}

double curvature_limit_of(const MeasuredError& error, const Curvatures& d) {
  std::vector<double> sizes;
  for (const auto& [reading, deviation] : d) {
    sizes.push_back(std::abs(deviation));
  }
  const double by_scatter = kMostScales * kMadToSigma * median(sizes);
  return std::max(by_scatter, kMostSteps * resolution_of(error)) + kFileResolution;
}

/// The largest |d| of the pass.
double largest_in(const Curvatures& d, const Pass& pass) {
  double largest = 0.0;
  for (const std::size_t reading : pass) {
    largest = std::max(largest, std::abs(d.at(reading)));
  }
  return largest;
}

/// All passes; pass `number` without the readings in `left_out`.
std::vector<Pass> passes_without(std::vector<Pass> passes, std::size_t number,
                                 const Pass& left_out) {
  std::erase_if(passes[number], [&](std::size_t reading) {
    return std::find(left_out.begin(), left_out.end(), reading) != left_out.end();
  });
  return passes;
}

/// Readings of the pass that may be wrong: those with |d| above the limit, and their neighbours.
/// The neighbours are included because the |d| of a wrong reading may be below the limit by chance.
/// Empty if there are more candidates than two wrong readings can explain.
Pass candidates_of(const Curvatures& d, const Pass& pass, double limit) {
  constexpr std::size_t kMost = 12;  // one wrong reading also changes the curvature of its two
                                     // neighbours
  Pass candidates;
  for (std::size_t k = 0; k < pass.size(); ++k) {
    const std::size_t first = k < 1 ? 0 : k - 1, last = std::min(k + 1, pass.size() - 1);
    for (std::size_t i = first; i <= last; ++i) {
      if (std::abs(d.at(pass[i])) > limit) {
        candidates.push_back(pass[k]);
        break;
      }
    }
  }
  return candidates.size() <= kMost ? candidates : Pass{};
}

/// The one or two readings without which the largest |d| of the pass is smallest and within the
/// limit. Empty if there are none.
Pass culprits_of(const MeasuredError& error, const std::vector<Pass>& passes, std::size_t number,
                 const Curvatures& d, double limit) {
  const Pass candidates = candidates_of(d, passes[number], limit);
  Pass culprits;
  double least = limit;
  const auto try_without = [&](const Pass& left_out) {
    const std::vector<Pass> others = passes_without(passes, number, left_out);
    if (others[number].size() < kFewestPositions - 1) {
      return;
    }
    const double rest = largest_in(deviations_of(error, others), others[number]);
    if (rest <= least) {
      least = rest;
      culprits = left_out;
    }
  };

  for (const std::size_t one : candidates) {
    try_without({one});
  }
  for (std::size_t i = 0; culprits.size() != 1 && i < candidates.size(); ++i) {
    for (std::size_t k = i + 1; k < candidates.size(); ++k) {
      try_without({candidates[i], candidates[k]});
    }
  }
  return culprits;
}

}  // namespace

std::vector<ReadingOff> readings_off(const MeasuredError& error) {
  const std::vector<Pass> passes = passes_of(error);
  if (passes.empty()) {
    return {};
  }
  const Curvatures d = deviations_of(error, passes);
  const double limit = curvature_limit_of(error, d);
  std::vector<ReadingOff> found;
  for (std::size_t number = 0; number < passes.size(); ++number) {
    if (!(largest_in(d, passes[number]) > limit)) {
      continue;
    }
    for (const std::size_t reading : culprits_of(error, passes, number, d, limit)) {
      found.push_back({reading, std::abs(d.at(reading))});
    }
  }
  std::sort(found.begin(), found.end(),
            [](const ReadingOff& a, const ReadingOff& b) { return a.reading < b.reading; });
  return found;
}

}  // namespace abbe::calib::direct
