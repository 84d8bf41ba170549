#include "abbe/calib/direct/readings_off.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace abbe::calib::direct {
namespace {

/// 13 positions, forward and backward, offsets of 50 um between the passes, noise of 0.3 um.
MeasuredError measured_in_runs(int runs, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  MeasuredError error{.name = "EXX", .readings = {}};
  for (int run = 1; run <= runs; ++run)
    for (const bool forward : {true, false}) {
      const double offset = 50e-6 * normal(random), slope = 20e-6 * normal(random);
      for (int i = 0; i < 13; ++i) {
        const double x_m = -0.3 + 0.05 * i;
        const double value = 10e-6 * std::sin(15.0 * x_m) + offset + slope * x_m;
        error.readings.push_back({x_m, value + 0.3e-6 * normal(random), run, forward});
      }
    }
  return error;
}

std::vector<std::size_t> readings_found(const MeasuredError& error) {
  std::vector<std::size_t> readings;
  for (const ReadingOff& off : readings_off(error)) readings.push_back(off.reading);
  return readings;
}

using ReadingNumbers = std::vector<std::size_t>;

TEST(ReadingsOff, AreSentinelsAtAnyPosition) {
  for (const double value : {-9999e-6, 1e24, 200e-6})
    for (const std::size_t at : {0u, 1u, 2u, 7u, 11u, 12u, 13u, 30u}) {
      MeasuredError error = measured_in_runs(3);
      error.readings[at].value = value;
      EXPECT_EQ(readings_found(error), ReadingNumbers{at}) << value << " at " << at;
    }
}

TEST(ReadingsOff, AreNotTheInnocentOnes) {
  for (unsigned seed = 1; seed <= 200; ++seed)
    for (const int runs : {1, 2, 3, 5})
      EXPECT_EQ(readings_found(measured_in_runs(runs, seed)), ReadingNumbers{}) << seed;
}

TEST(ReadingsOff, AreNotTheStepsOfACoarseInstrument) {
  constexpr double kStep = 1e-6;
  MeasuredError error = measured_in_runs(3);
  for (Reading& r : error.readings) r.value = 0.0;
  error.readings[5].value = kStep;  // most deviations are exactly 0
  error.readings[31].value = -kStep;
  EXPECT_EQ(readings_found(error), ReadingNumbers{});
  error.readings[31].value = -9999e-6;
  EXPECT_EQ(readings_found(error), ReadingNumbers{31});
}

TEST(ReadingsOff, AreASentinelAmongEqualValues) {
  MeasuredError error = measured_in_runs(3);
  for (Reading& r : error.readings) r.value = 0.0;
  error.readings[31].value = -9999e-6;
  EXPECT_EQ(readings_found(error), ReadingNumbers{31});
}

TEST(ReadingsOff, AreNotAStepThatAllRunsShow) {
  MeasuredError error = measured_in_runs(3);
  for (Reading& r : error.readings)
    if (std::abs(r.position_m) < 1e-6) r.value += 100e-6;
  EXPECT_EQ(readings_found(error), ReadingNumbers{});
}

TEST(ReadingsOff, AreFoundWhenThereAreTwo) {
  for (const std::size_t second : {5u, 6u, 9u, 20u, 60u}) {
    MeasuredError error = measured_in_runs(3);
    error.readings[4].value = -9999e-6;
    error.readings[second].value = -9999e-6;
    EXPECT_EQ(readings_found(error), (ReadingNumbers{4, second})) << second;
  }
}

TEST(ReadingsOff, AreFoundInOneRun) {
  MeasuredError error = measured_in_runs(1);
  error.readings[6].value = -9999e-6;
  EXPECT_EQ(readings_found(error), ReadingNumbers{6});
}

TEST(ReadingsOff, OfFewPositionsAreNotTested) {
  const MeasuredError error{.name = "EXX", .readings = {{0.0, 0.0, 1, true}, {0.1, 1.0, 1, true}}};
  EXPECT_EQ(readings_found(error), ReadingNumbers{});
  EXPECT_EQ(readings_found({.name = "EC0Y", .readings = {{0.0, 1e-6, 1, true}}}), ReadingNumbers{});
}

}  // namespace
}  // namespace abbe::calib::direct
