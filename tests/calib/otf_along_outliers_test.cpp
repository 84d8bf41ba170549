/// Outliers along the direction of travel, where only time shows them: in the tracker's samples and
/// in the scale readings.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "abbe/calib/internal/otf/samples/reading_jumps.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "encoder_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr double kShare = 0.01, kSize_m = 200e-6;

/// Calls `displace(i, by_m)` for one of a hundred moving samples, with a displacement along the
/// travel.
template <class Displace>
void displace_along(const EncoderRun& made, Displace displace) {
  const std::vector<Vector3> q = drive(made.run.path, EncoderRunOptions{}.speed_m_s, 250.0);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> share;
  std::normal_distribution<double> normal;
  for (std::size_t i = 1; i + 1 < q.size(); ++i) {
    const Vector3 travel = q[i + 1] - q[i - 1];
    if (travel.norm() > 0.0 && share(random) < kShare) {
      displace(i, kSize_m * normal(random) * travel.normalized());
    }
  }
}

EncoderRun with_wrong_samples() {
  EncoderRun made = make_encoder_run({});
  displace_along(made, [&](std::size_t i, const Vector3& by_m) {
    made.run.samples[i].p_tracker_m += made.run.T_machine_tracker.R.transpose() * by_m;
  });
  return made;
}

EncoderRun with_wrong_readings() {
  EncoderRun made = make_encoder_run({});
  displace_along(made,
                 [&](std::size_t i, const Vector3& by_m) { made.log.readings[i].q_m += by_m; });
  return made;
}

/// Readings of zero, as a fieldbus gives them when a message is lost.
EncoderRun with_zero_readings() {
  EncoderRun made = make_encoder_run({});
  displace_along(made, [&](std::size_t i, const Vector3&) { made.log.readings[i].q_m.setZero(); });
  return made;
}

double rms_m(const EncoderRun& made, const Identification& id) {
  std::vector<Vector3> points = tensor_grid(made.run.machine.nodes);
  for (Vector3& p : points) {
    p += made.run.machine.target_offset_m;
  }
  return rigid_free(points, errors_left(made.run, id.solution.model))->rigid_free.rms_m;
}

struct WrongAlong {
  const char* name;
  EncoderRun (*made)();
  const char* note;  ///< null: the samples are excluded
};

class OutliersAlong : public testing::TestWithParam<WrongAlong> {};
INSTANTIATE_TEST_SUITE_P(OtfOutliers, OutliersAlong,
                         testing::Values(WrongAlong{"Samples", with_wrong_samples, nullptr},
                                         WrongAlong{"Readings", with_wrong_readings,
                                                    "jump away from their neighbours"},
                                         WrongAlong{"ZeroReadings", with_zero_readings,
                                                    "jump away from their neighbours"}),
                         [](const auto& one) { return one.param.name; });

/// Without the screening the stated uncertainty of the component along the travel became 2.6 times
/// as large, and the model as uncertain as without the readings.
TEST_P(OutliersAlong, LeaveTheComponentItsWeight) {
  const EncoderRun clean = make_encoder_run({}), made = GetParam().made();
  const auto of_clean = identify_with_readings(clean), found = identify_with_readings(made);
  ASSERT_TRUE(of_clean && found) << found.error().text;
  EXPECT_LT(found->solution.synchronisation->sigma_factor, 1.2);
  EXPECT_LT(rms_m(made, *found), 1.15 * rms_m(clean, *of_clean));
  EXPECT_GT(found->solution.synchronisation->rows,
            0.95 * static_cast<double>(of_clean->solution.synchronisation->rows));
  EXPECT_NEAR(found->solution.synchronisation->clock.offset_s, made.clock.offset_s,
              4.0 * found->solution.synchronisation->u_offset_s);
  if (GetParam().note != nullptr) {
    EXPECT_THAT(found->observations.notes, Contains(HasSubstr(GetParam().note)));
  } else {
    EXPECT_GT(found->observations.set_aside.off_line, 100u);
  }
}

TEST(SoundReadings, NothingIsSetAside) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    const EncoderRun clean = make_encoder_run({.seed = seed});
    EXPECT_EQ(without_jumps(clean.log).jumps, 0u);
    const auto found = identify_with_readings(clean);
    ASSERT_TRUE(found) << found.error().text;
    EXPECT_EQ(found->observations.set_aside.samples(), 0u);
    EXPECT_THAT(found->observations.notes, Not(Contains(HasSubstr("scale readings"))));
  }
}

/// A machine that starts, accelerates with 2 m/s^2 and stops, read every 4 ms with a resolution of
/// 1 um, has no jumps; a single wrong reading is one.
TEST(ReadingJumps, AreNotTheStartAndStopOfAnAxis) {
  EncoderLog log;
  for (int i = 0; i < 400; ++i) {
    const double t = 0.004 * i - 0.4, ramp = std::clamp(t, 0.0, 0.1),
                 back = std::clamp(t - 0.6, 0.0, 0.1);
    const double run = std::clamp(t, 0.0, 0.7) - ramp;
    const double x = ramp * ramp + 0.2 * run - back * back;
    log.readings.push_back({0.004 * i, {std::round(1e6 * x) * 1e-6, 0.0, 0.0}});
  }
  EXPECT_EQ(without_jumps(log).jumps, 0u);
  log.readings[200].q_m.x() += 50e-6;
  const WithoutJumps found = without_jumps(log);
  EXPECT_EQ(found.jumps, 1u);
  ASSERT_TRUE(found.log);
  EXPECT_EQ(found.log->readings.size(), 399u);
}

}  // namespace
