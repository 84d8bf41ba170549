// Scale readings that do not belong to the run, are incomplete, or have worse times than stated.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>

#include "encoder_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::HasSubstr;

/// Greatest difference of two models on the nodes, in units of the uncertainty of the first.
double difference(const Identification& a, const Identification& b) {
  const Eigen::VectorXd d = a.solution.model.U() - b.solution.model.U();
  double greatest = 0.0;
  for (Eigen::Index i = 0; i < d.size(); ++i) {
    const double u = std::sqrt(a.solution.covariance_with_rigid(i, i));
    greatest = u > 1e-10 ? std::max(greatest, std::abs(d(i)) / u) : greatest;
  }
  return greatest;
}

const EncoderRun& good_run() {
  static const EncoderRun run = make_encoder_run({});
  return run;
}

Result<Identification> without_readings(const EncoderRun& run) {
  return identify(run.run.samples, run.run.machine, run.run.path, run.run.noise, run.run.options);
}

struct Fault {
  std::string text;  ///< in the message
  ErrorCode code;
  std::function<void(EncoderLog&)> make;
};
class FaultOfReadings : public testing::TestWithParam<Fault> {};
INSTANTIATE_TEST_SUITE_P(
    Otf, FaultOfReadings,
    testing::Values(Fault{"they are of another run", ErrorCode::AlignmentFailed,
                          [](EncoderLog& log) {
                            // every leg in another order
                            std::reverse(log.readings.begin(), log.readings.end());
                            for (std::size_t i = 0; i < log.readings.size(); ++i) {
                              log.readings[i].time_s = static_cast<double>(i) / 250.0;
                            }
                          }},
                    Fault{"Y reversed", ErrorCode::AlignmentFailed,
                          [](EncoderLog& log) {
                            for (EncoderReading& r : log.readings) {
                              r.q_m.y() = -r.q_m.y();
                            }
                          }},
                    Fault{"lengths in m instead of mm", ErrorCode::AlignmentFailed,
                          [](EncoderLog& log) {
                            for (EncoderReading& r : log.readings) {
                              r.q_m *= 1e-3;
                            }
                          }},
                    Fault{"of the segments only", ErrorCode::AlignmentFailed,
                          [](EncoderLog& log) { log.readings.resize(log.readings.size() / 10); }},
                    Fault{"time must ascend", ErrorCode::BadInput,
                          [](EncoderLog& log) {
                            log.readings[100].time_s = log.readings[99].time_s;
                          }},
                    Fault{"is not a number", ErrorCode::NotFinite,
                          [](EncoderLog& log) { log.readings[7].q_m.x() = std::nan(""); }},
                    Fault{"needs at least 2", ErrorCode::BadInput,
                          [](EncoderLog& log) { log.readings.resize(1); }},
                    Fault{"must be positive", ErrorCode::BadInput,
                          [](EncoderLog& log) { log.sigma_time_s = 0.0; }},
                    Fault{"with the stated clock", ErrorCode::AlignmentFailed, [](EncoderLog& log) {
                            log.known_clock = ClockMap{0.75, 0.0, 0.0};
                          }}));

TEST_P(FaultOfReadings, IsNamed) {
  EncoderRun run = good_run();
  GetParam().make(run.log);
  const auto refused = identify_with_readings(run);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, GetParam().code);
  EXPECT_THAT(refused.error().text, HasSubstr(GetParam().text));
}

TEST(OtfReadings, WithAnOffsetOfHoursAreMatched) {
  EncoderRun run = good_run();
  constexpr double kLater_s = 7200.0;
  for (EncoderReading& r : run.log.readings) {
    r.time_s += kLater_s;
  }
  const auto id = identify_with_readings(run);
  ASSERT_TRUE(id) << id.error().text;
  ASSERT_TRUE(id->solution.synchronisation);
  const Synchronisation& s = *id->solution.synchronisation;
  EXPECT_NEAR(s.clock.offset_s, run.clock.offset_s + kLater_s, 4.0 * s.u_offset_s);
}

/// Segments without readings keep their rows across the travel.
TEST(OtfReadings, WithGapsGiveFewerRowsAndTheSameClock) {
  EncoderRun run = good_run();
  auto& readings = run.log.readings;
  const auto at = [&](double share) {
    return readings.begin() +
           static_cast<std::ptrdiff_t>(share * static_cast<double>(readings.size()));
  };
  readings.erase(at(0.5), at(0.7));
  readings.erase(at(0.1), at(0.2));

  const auto whole = identify_with_readings(good_run());
  const auto id = identify_with_readings(run);
  ASSERT_TRUE(id) << id.error().text;
  ASSERT_TRUE(id->solution.synchronisation);
  const Synchronisation& s = *id->solution.synchronisation;
  EXPECT_LT(s.rows, whole->solution.synchronisation->rows * 9 / 10);
  EXPECT_EQ(id->observations.segments_used, whole->observations.segments_used);
  EXPECT_NEAR(s.clock.offset_s, run.clock.offset_s, 4.0 * s.u_offset_s);
}

/// Times that are 5 times worse than stated: the rows along the path are used with the uncertainty
/// that their residuals show.
TEST(OtfReadings, WithTimesWorseThanStatedGetALargerUncertainty) {
  const EncoderRun run = make_encoder_run({.sigma_time_s = 100e-6, .stated_sigma_time_s = 20e-6});
  const auto id = identify_with_readings(run);
  ASSERT_TRUE(id) << id.error().text;
  ASSERT_TRUE(id->solution.synchronisation);
  const Synchronisation& s = *id->solution.synchronisation;
  EXPECT_GT(s.sigma_factor, 3.0);
  EXPECT_LT(s.sigma_factor, 7.0);
  EXPECT_NEAR(s.clock.offset_s, run.clock.offset_s, 4.0 * s.u_offset_s);
  ASSERT_FALSE(id->observations.notes.empty());
  EXPECT_THAT(id->observations.notes.back(), HasSubstr("times as large as stated"));

  const auto across = without_readings(run);
  EXPECT_LT(difference(*across, *id), 4.5);
}

/// Times that are 50 times worse: the estimate is that without readings.
TEST(OtfReadings, WithUselessTimesAreNotUsed) {
  const EncoderRun run = make_encoder_run({.sigma_time_s = 1e-3, .stated_sigma_time_s = 10e-6});
  const auto id = identify_with_readings(run);
  ASSERT_TRUE(id) << id.error().text;
  EXPECT_FALSE(id->solution.synchronisation);
  ASSERT_FALSE(id->observations.notes.empty());
  EXPECT_THAT(id->observations.notes.back(), HasSubstr("were not used along the path"));
  EXPECT_EQ(id->solution.model.U(), without_readings(run)->solution.model.U());
}

}  // namespace
