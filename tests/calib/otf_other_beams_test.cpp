/// Points in another frame than that of the tracker: their noise shows it.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/solve/other_beams.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

std::optional<OtherBeams> other_beams_in(MadeRun run) {
  const auto found = *identify(run.samples, run.machine, run.path, run.noise, run.options);
  return find_other_beams(found.observations, found.solution);
}

const Vector3 kMiddle_m(0.0, 0.0, -0.2);  // of coarse_machine()

MadeRun moved_by(MadeRun run, const RigidTransform& T) {
  for (TrackerObservation& sample : run.samples) {
    sample.p_tracker_m = T * sample.p_tracker_m;
  }
  return run;
}

TEST(OtherBeams, OfTheTrackersFrameIsNotContradicted) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    EXPECT_FALSE(other_beams_in(make_run({.seed = seed, .noise_seed = seed, .rate_hz = 500.0})))
        << seed;
  }
}

TEST(OtherBeams, OfMachineCoordinatesIsContradictedAndTheTrackerIsFound) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const MadeRun run = make_run({.seed = seed, .noise_seed = seed, .rate_hz = 500.0});
    const auto other = other_beams_in(moved_by(run, run.T_machine_tracker));
    ASSERT_TRUE(other) << seed;
    // In this frame the tracker stands at T_machine_tracker.t_m.
    const double cosine =
        other->direction.dot((run.T_machine_tracker.t_m - kMiddle_m).normalized());
    EXPECT_GT(std::abs(cosine), std::cos(0.35)) << seed;
    EXPECT_GT(other->across_m, 1.3 * other->along_m);
  }
}

/// Noise that is alike in all directions, or that the machine makes in one of them, states nothing
/// of the beams.
TEST(OtherBeams, IsNotFoundInOtherNoise) {
  for (const Vector3& vibration_m : {Vector3(10e-6, 10e-6, 10e-6), Vector3(0.0, 15e-6, 0.0)}) {
    MadeRun run = make_run({.noise_factor = 0.1, .rate_hz = 500.0});
    std::mt19937_64 random(5);
    std::normal_distribution<double> normal;
    for (TrackerObservation& sample : run.samples) {
      const Vector3 moved_m(normal(random), normal(random), normal(random));
      sample.p_tracker_m += run.T_machine_tracker.R.transpose() * moved_m.cwiseProduct(vibration_m);
    }
    EXPECT_FALSE(other_beams_in(run)) << vibration_m.transpose();
  }
}

/// Waves that no table follows are no noise.
TEST(OtherBeams, IsNotContradictedByErrorsOfTheMachine) {
  MadeRun run = make_run({.rate_hz = 500.0});
  for (TrackerObservation& sample : run.samples) {
    const Vector3 q_m = run.T_machine_tracker * sample.p_tracker_m;
    const Vector3 wave_m(0.0, 20e-6 * std::sin(2.0 * M_PI * q_m.x() / 0.1), 0.0);
    sample.p_tracker_m += run.T_machine_tracker.R.transpose() * wave_m;
  }
  EXPECT_FALSE(other_beams_in(run));
}

}  // namespace
