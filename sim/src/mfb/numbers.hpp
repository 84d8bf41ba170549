#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "abbe/sim/noise.hpp"

namespace abbe::sim::mfb {

/// Random numbers of one object (pose, touch, ...): the n-th number of the object with number
/// `index`.
struct Numbers {
  std::uint64_t seed;
  NoiseStream stream;
  std::uint64_t index;

  [[nodiscard]] double number(std::uint64_t n) const {
    constexpr std::uint64_t kMostNumbers = 4096;
    return gaussian(seed, stream, index * kMostNumbers + n);
  }
  [[nodiscard]] Eigen::Vector3d vector(std::uint64_t n) const {
    return {number(n), number(n + 1), number(n + 2)};
  }
};

}  // namespace abbe::sim::mfb
