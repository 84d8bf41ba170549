#pragma once
/// Faults of a tracker's stream: outliers, beam breaks, another reflector. Deterministic from the
/// generator that is passed.

#include <cmath>
#include <cstddef>
#include <random>
#include <span>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::tests::otf {

using Stream = std::vector<calib::otf::TrackerObservation>;

/// Time of a sample from which a fault of `longest_s` ends before the run does; neither begins in
/// its first or last second.
inline double time_of_fault_s(const Stream& samples, double longest_s, std::mt19937_64& random) {
  const double from_s = samples.front().time_s + 1.0;
  const double to_s = samples.back().time_s - 1.0 - longest_s;
  return std::uniform_real_distribution<double>(from_s, to_s)(random);
}

/// Calls `change` for each sample in [from_s, from_s + length_s).
template <class Change>
void change_between(Stream& samples, double from_s, double length_s, Change change) {
  for (calib::otf::TrackerObservation& s : samples) {
    if (s.time_s >= from_s && s.time_s < from_s + length_s) {
      change(s);
    }
  }
}

inline calib::Vector3 normal_vector(double sigma_m, std::mt19937_64& random) {
  std::normal_distribution<double> normal(0.0, sigma_m);
  const double x = normal(random), y = normal(random), z = normal(random);
  return {x, y, z};
}

/// A share of the samples is off by a normal deviate with `sigma_m` in each coordinate.
inline void add_outliers(Stream& samples, double share, double sigma_m, std::mt19937_64& random) {
  std::bernoulli_distribution is_outlier(share);
  for (calib::otf::TrackerObservation& s : samples) {
    if (is_outlier(random)) {
      s.p_tracker_m += normal_vector(sigma_m, random);
    }
  }
}

/// A share of the samples has another range.
inline void add_range_outliers(Stream& samples, double share, double sigma_m,
                               std::mt19937_64& random) {
  std::bernoulli_distribution is_outlier(share);
  std::normal_distribution<double> normal(0.0, sigma_m);
  for (calib::otf::TrackerObservation& s : samples) {
    if (is_outlier(random)) {
      s.p_tracker_m += normal(random) * s.p_tracker_m.normalized();
    }
  }
}

/// Groups of successive samples that are off by the same vector.
inline void add_clusters(Stream& samples, std::size_t count, double length_s, double sigma_m,
                         std::mt19937_64& random) {
  for (std::size_t i = 0; i < count; ++i) {
    const double from_s = time_of_fault_s(samples, length_s, random);
    const calib::Vector3 by_m = normal_vector(sigma_m, random);
    change_between(samples, from_s, length_s, [&](auto& s) { s.p_tracker_m += by_m; });
  }
}

/// Beam breaks at random times, of random length between the two.
inline void add_breaks(Stream& samples, std::size_t count, double shortest_s, double longest_s,
                       std::mt19937_64& random) {
  for (std::size_t i = 0; i < count; ++i) {
    const double length_s = std::uniform_real_distribution<double>(shortest_s, longest_s)(random);
    change_between(samples, time_of_fault_s(samples, longest_s, random), length_s,
                   [](auto& s) { s.valid = false; });
  }
}

/// A beam break after which all ranges are longer by `by_m`.
inline void add_range_step(Stream& samples, double break_s, double by_m, std::mt19937_64& random) {
  const double from_s = time_of_fault_s(samples, break_s, random);
  change_between(samples, from_s, break_s, [](auto& s) { s.valid = false; });
  change_between(samples, from_s + break_s, samples.back().time_s,
                 [&](auto& s) { s.p_tracker_m += by_m * s.p_tracker_m.normalized(); });
}

/// The tracker measures another, fixed reflector, after a beam break of `gap_s` on each side.
inline void add_other_target(Stream& samples, double length_s, double gap_s, double away_m,
                             std::mt19937_64& random) {
  const double from_s = time_of_fault_s(samples, length_s + 2.0 * gap_s, random);
  const calib::Vector3 direction = normal_vector(1.0, random).normalized();
  calib::Vector3 at_m = calib::Vector3::Zero();
  change_between(samples, from_s, 1e-9 + 2.0 * gap_s + length_s, [&](auto& s) {
    at_m = at_m.isZero() ? calib::Vector3(s.p_tracker_m + away_m * direction) : at_m;
    const double since_s = s.time_s - from_s;
    s.valid = since_s >= gap_s && since_s < gap_s + length_s;
    s.p_tracker_m = at_m + normal_vector(2e-6, random);
  });
}

}  // namespace abbe::tests::otf
