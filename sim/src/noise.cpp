#include "abbe/sim/noise.hpp"

#include <cmath>
#include <numbers>

namespace abbe::sim {
namespace {

/// The finaliser of SplitMix64 [Steele, Lea, Flood 2014]: a bijection that maps
/// neighbouring inputs to unrelated outputs.
std::uint64_t scatter(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

double unit(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) {
  const std::uint64_t bits = scatter(scatter(scatter(seed) ^ stream) ^ index);
  // 53 random bits; the result is never 0 and never 1
  return (static_cast<double>(bits >> 11) + 0.5) * 0x1.0p-53;
}

}  // namespace

double uniform(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) {
  return unit(seed, stream, 2 * index);
}

double gaussian(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) {
  // Box and Muller
  const double radius = std::sqrt(-2.0 * std::log(unit(seed, stream, 2 * index)));
  return radius * std::cos(2.0 * std::numbers::pi * unit(seed, stream, 2 * index + 1));
}

}  // namespace abbe::sim
