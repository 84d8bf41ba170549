#pragma once
/// Random numbers by index: a number depends only on (seed, stream, index), not on the order of the
/// calls. The wall clock, the order of threads and a lost connection therefore never change what
/// the simulated instruments measure. Pure.

#include <cstdint>

namespace abbe::sim {

/// The purpose of a random number; each purpose has its own sequence.
enum class NoiseStream : std::uint64_t {
  Range = 1,
  Azimuth,
  Elevation,
  Burst,
  Command,
  Truth,
  Squareness,
  Backlash,
  Probe,
  Artefact,
  Nest,
  Drift,
  Bar,
  BarCalibration,
  BarPose,
  BarTouch,
  BarTemperature,
  BarShape,
  StepGauge,
  Encoder = 1000,
  CounterCard = 2000,
};

/// A random number with uniform distribution in (0, 1).
[[nodiscard]] double uniform(std::uint64_t seed, std::uint64_t stream, std::uint64_t index);
/// A random number with standard normal distribution.
[[nodiscard]] double gaussian(std::uint64_t seed, std::uint64_t stream, std::uint64_t index);

[[nodiscard]] inline double uniform(std::uint64_t seed, NoiseStream stream, std::uint64_t index) {
  return uniform(seed, static_cast<std::uint64_t>(stream), index);
}
[[nodiscard]] inline double gaussian(std::uint64_t seed, NoiseStream stream, std::uint64_t index) {
  return gaussian(seed, static_cast<std::uint64_t>(stream), index);
}

}  // namespace abbe::sim
