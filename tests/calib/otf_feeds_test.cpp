/// Runs at four feeds predict 200 points of the standing machine ([Sanders 2023] section 2.2), on a
/// simulated machine whose errors are known.

#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/verify/compare.hpp"
#include "standstill_run.hpp"

namespace abbe::calib::otf {
namespace {

using tests::otf::MadeRun;

constexpr std::size_t kReferencePoints = 200;
constexpr double kFeedsMmPerMin[] = {2500.0, 5000.0, 10'000.0, 15'000.0};
constexpr double kSecondsOfStandstill = 1.0;  // at 250 points per second

VolumetricModel model_at_feed(double feed_mm_per_min, unsigned noise_seed) {
  const MadeRun run = tests::otf::make_run(
      {.noise_seed = noise_seed, .in_datum = true, .speed_m_s = feed_mm_per_min * 1e-3 / 60.0});
  return identify(run.samples, run.machine, run.path, run.noise, run.options)
      .value()
      .solution.model;
}

/// Means of the tracker's points at each position, from another place of the tracker.
struct ReferencePoints {
  verify::Observations observed;
  double noise_m = 0.0;  ///< expected mean length of the error of a point
};

ReferencePoints reference_points() {
  const MadeRun run = tests::otf::make_run({.in_datum = true});
  std::mt19937_64 random(77);
  const ParameterLayout layout = tests::otf::layout_of(run.machine);
  const Vector3& t = run.machine.target_offset_m;
  const Vector3 tracker_m(1.2, -0.9, 0.3);
  const double mean_of = 1.0 / std::sqrt(250.0 * kSecondsOfStandstill);

  std::vector<verify::MeasuredPoint> points;
  double squares_m2 = 0.0;
  for (const Vector3& q : tests::otf::stop_positions(run.machine, kReferencePoints, random)) {
    const Vector3 V = volumetric_error(layout, {run.truth.data(), layout.model_size()}, q, t);
    const Vector3 exact = q + t + V - tracker_m;
    const Vector3 seen = tests::otf::with_noise(exact, run.noise, mean_of, random);
    points.push_back({q, seen});
    squares_m2 += (seen - exact).squaredNorm() / kReferencePoints;
  }
  return {verify::observe(points).value(), std::sqrt(squares_m2)};
}

/// Residuals contain the noise of the reference points and the error of the model, no more.
TEST(OtfFeeds, FourFeedsPredictStandstillPoints) {
  const ReferencePoints reference = reference_points();
  const Vector3 t = tests::otf::coarse_machine("[w X' b Y Z (C1) t]").target_offset_m;
  unsigned seed = 1;
  for (const double feed : kFeedsMmPerMin) {
    const VolumetricModel model = model_at_feed(feed, ++seed);
    const auto c = verify::compare_at_points(reference.observed, model, t);
    ASSERT_TRUE(c) << c.error().text;
    double u_m2 = 0.0;
    for (const std::size_t i : c->inside) {
      u_m2 += model.error_at(reference.observed.readings_m[i], t).cov_V_m2.trace() /
              static_cast<double>(c->inside.size());
    }

    const double expected_m = std::sqrt(reference.noise_m * reference.noise_m + u_m2);
    EXPECT_EQ(c->inside.size(), kReferencePoints);
    EXPECT_LT(c->after.rms_m, 1.3 * expected_m) << feed;
    EXPECT_GT(c->after.rms_m, 0.7 * reference.noise_m) << feed;
    EXPECT_EQ(verify::effect_at_points(*c), verify::Effect::Better);
    ::testing::Test::RecordProperty("mae_um_at_" + std::to_string(static_cast<int>(feed)),
                                    std::to_string(1e6 * c->after.mean_m));
  }
}

}  // namespace
}  // namespace abbe::calib::otf
