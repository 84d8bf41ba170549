#pragma once
/// Random numbers that are equal with every standard library.

#include <Eigen/Core>
#include <cmath>
#include <random>

namespace abbe::tests::never_worse {

inline double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random() >> 11U) / 9007199254740992.0);
}
/// Random number between `low` and `high` whose logarithm is uniformly distributed.
inline double log_uniform(std::mt19937_64& random, double low, double high) {
  return low * std::pow(high / low, uniform(random, 0.0, 1.0));
}
inline double normal(std::mt19937_64& random) {  // Box-Muller
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(random, 0.0, 1.0)));
  return radius * std::cos(2.0 * M_PI * uniform(random, 0.0, 1.0));
}
inline Eigen::Vector3d normal3(std::mt19937_64& random) {
  const double x = normal(random), y = normal(random), z = normal(random);
  return {x, y, z};
}
inline Eigen::Vector3d direction(std::mt19937_64& random) {
  return normal3(random).normalized();
}

}  // namespace abbe::tests::never_worse
