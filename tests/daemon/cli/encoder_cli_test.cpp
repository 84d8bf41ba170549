/// `abbe identify otf --encoder`: scale readings with times, as files.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/config/calibration_input.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe_command.hpp"
#include "encoder_run.hpp"
#include "made_run_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using test::Ran;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// The clock of the scales is 0.25 s ahead and fast by 30 ppm; times are within 20 us.
class EncoderCli : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("encoder_cli_{}", ::getpid());
    fs::create_directories(folder_);
    made_ = tests::otf::make_encoder_run({.seed = 3});
    write("machine.toml", test::made_machine_toml(made_.run.machine.target_offset_m));
    write("path.csv", test::made_path_csv(made_.run.path));
    write("tracker.csv", test::made_tracker_csv(made_.run.samples));
    synchronised_ = identify(made_.log, "out", "--json");
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static void write(const std::string& name, const std::string& text) {
    test::write_text(folder_ / name, text);
  }
  static Ran identify(const calib::otf::EncoderLog& log, const std::string& out,
                      const std::string& more = "") {
    write("encoder.csv", test::made_encoder_csv(log));
    return test::run_abbe(
        folder_, fmt::format("identify otf --machine machine.toml --path path.csv --tracker "
                             "tracker.csv --encoder encoder.csv -o {} {}",
                             out, more));
  }

  /// Without scale readings, identified once, in the folder "without".
  static const Ran& without_readings() {
    static const Ran ran =
        test::run_abbe(folder_,
                       "identify otf --machine machine.toml --path path.csv --tracker tracker.csv "
                       "--accept-path-orientation -o without");
    return ran;
  }

  static inline fs::path folder_;
  static inline tests::otf::EncoderRun made_;
  static inline Ran synchronised_;
};

TEST_F(EncoderCli, ReportsOffsetAndDriftOfTheClocks) {
  ASSERT_EQ(synchronised_.exit, 0) << synchronised_.out << synchronised_.err;
  const auto clocks = nlohmann::json::parse(synchronised_.out).at("clocks");
  const double u_us = clocks.at("u_offset_us"), u_ppm = clocks.at("u_drift_ppm");
  const double at_s = clocks.at("at_tracker_time_s");
  EXPECT_GT(u_us, 0.0);
  EXPECT_LT(u_us, 20.0);
  EXPECT_NEAR(clocks.at("offset_us").get<double>(), 1e6 * (made_.clock.machine_s(at_s) - at_s),
              4.0 * u_us);
  EXPECT_NEAR(clocks.at("drift_ppm").get<double>(), 1e6 * made_.clock.drift, 4.0 * u_ppm);
  EXPECT_GT(clocks.at("observations_along").get<int>(), 500);
}

TEST_F(EncoderCli, GivesTheResultOfTheLibrary) {
  const auto config = load_config(folder_ / "machine.toml");
  ASSERT_TRUE(config);
  auto options = otf_options(made_.run.samples, *config);
  options.encoders = &made_.log;
  const auto found = calib::otf::identify(made_.run.samples, *otf_machine(config->machine),
                                          made_.run.path, otf_noise(config->machine), options);
  ASSERT_TRUE(found) << found.error().text;
  const auto document = read_model(folder_ / "out/model.json");
  ASSERT_TRUE(document);
  // The files contain decimal numbers in mm.
  EXPECT_LT((document->model.U() - found->solution.model.U()).cwiseAbs().maxCoeff(), 1e-12);
}

TEST_F(EncoderCli, TimesSince1970GiveTheSameModelAndClock) {
  auto log = made_.log;
  for (auto& r : log.readings) r.time_s += 1.7e9;
  auto samples = made_.run.samples;
  for (auto& s : samples) s.time_s += 1.7e9;
  write("tracker.csv", test::made_tracker_csv(samples));
  const auto ran = identify(log, "later", "--json");
  write("tracker.csv", test::made_tracker_csv(made_.run.samples));
  ASSERT_EQ(ran.exit, 0) << ran.out << ran.err;
  const auto clocks = nlohmann::json::parse(ran.out).at("clocks"),
             wanted = nlohmann::json::parse(synchronised_.out).at("clocks");
  EXPECT_NEAR(clocks.at("offset_us").get<double>(), wanted.at("offset_us").get<double>(),
              0.5 * wanted.at("u_offset_us").get<double>());
  EXPECT_NEAR(clocks.at("at_tracker_time_s").get<double>() - 1.7e9,
              wanted.at("at_tracker_time_s").get<double>(), 1e-6);
  const auto a = read_model(folder_ / "out/model.json"),
             b = read_model(folder_ / "later/model.json");
  ASSERT_TRUE(a && b);
  EXPECT_LT((a->model.U() - b->model.U()).cwiseAbs().maxCoeff(), 0.01e-6);
}

/// The drive is at 24000 mm/min.
TEST_F(EncoderCli, NamesTimesThatAreNotInSeconds) {
  auto log = made_.log;
  for (auto& r : log.readings) r.time_s *= 1e3;
  const auto scales = identify(log, "ms");
  EXPECT_EQ(scales.exit, 3);
  EXPECT_THAT(scales.err, AllOf(HasSubstr("encoder.csv:2: time_s: with the times of lines 2 to "),
                                HasSubstr("expected 30 to 2e+05 mm/min"),
                                HasSubstr("they fit as milliseconds")));
}

TEST_F(EncoderCli, ComparesTheTimesOfTheTrackerWithTheFeedOfThePath) {
  const auto with_times = [&](double factor, const std::string& feed) {
    auto samples = made_.run.samples;
    for (auto& s : samples) s.time_s *= factor;
    write("times.csv", test::made_tracker_csv(samples));
    std::string text = "x_mm,y_mm,z_mm,feed_mm_per_min\n";
    for (const auto& q : made_.run.path.vertices_m)
      text +=
          fmt::format("{:.17g},{:.17g},{:.17g},{}\n", 1e3 * q.x(), 1e3 * q.y(), 1e3 * q.z(), feed);
    write("feed.csv", text);
    return test::run_abbe(folder_,
                          "identify otf --machine machine.toml --path feed.csv --tracker times.csv "
                          "--accept-path-orientation -o feed");
  };
  EXPECT_EQ(with_times(1.0, "24000").exit, 0);
  EXPECT_EQ(with_times(2.0, "24000").exit, 0) << "an override of 50 %";
  EXPECT_EQ(with_times(1.0, "").exit, 0);
  const auto slow = with_times(1e3, "24000");
  EXPECT_EQ(slow.exit, 3);
  EXPECT_THAT(slow.err, AllOf(HasSubstr("times.csv:2: time_s: with the times of lines 2 to "),
                              HasSubstr("feed.csv states a feed_mm_per_min of 24000"),
                              HasSubstr("expected 1200 to 4.8e+05 mm/min"),
                              HasSubstr("they fit as milliseconds")));
  EXPECT_THAT(with_times(1.0 / 60.0, "24000").err, HasSubstr("they fit as minutes"));
  EXPECT_EQ(with_times(1e3, "").exit, 3);
}

/// A trigger line: 1 us are 0.4 um of travel.
TEST_F(EncoderCli, ReadingsWithGoodTimesMakeTheModelMoreCertain) {
  const auto triggered = tests::otf::make_encoder_run({.seed = 3, .sigma_time_s = 1e-6});
  const auto ran = identify(triggered.log, "along", "--encoder-u-time-us 1");
  ASSERT_EQ(ran.exit, 0) << ran.out << ran.err;
  ASSERT_EQ(without_readings().exit, 0);
  const auto along = read_model(folder_ / "along/model.json");
  const auto across = read_model(folder_ / "without/model.json");
  ASSERT_TRUE(along && across);
  EXPECT_LT(along->model.covariance().trace(), 0.8 * across->model.covariance().trace());
}

TEST_F(EncoderCli, TimesThatAreWorseThanStatedGetTheirOwnWeight) {
  const auto late = tests::otf::make_encoder_run({.seed = 3, .sigma_time_s = 100e-6});
  const auto ran = identify(late.log, "late", "--json");
  ASSERT_EQ(ran.exit, 0) << ran.out << ran.err;
  const auto clocks = nlohmann::json::parse(ran.out).at("clocks");
  EXPECT_NEAR(clocks.at("u_time_us").get<double>(), 100.0, 40.0);
  EXPECT_THAT(identify(late.log, "late").out, AllOf(HasSubstr("clocks      scales minus tracker"),
                                                    HasSubstr("observations along the path"),
                                                    HasSubstr("times as large as stated")));
}

TEST_F(EncoderCli, UselessTimesAreNotUsedAndChangeNoBit) {
  const auto jitter = tests::otf::make_encoder_run({.seed = 3, .sigma_time_s = 1e-3});
  const auto ran = identify(jitter.log, "jitter", "--encoder-u-time-us 10");
  ASSERT_EQ(ran.exit, 0) << ran.out << ran.err;
  EXPECT_THAT(ran.out, AllOf(HasSubstr("the scale readings were not used along the path"),
                             Not(HasSubstr("clocks "))));
  ASSERT_EQ(without_readings().exit, 0);
  EXPECT_EQ(model_hash(*read_model(folder_ / "jitter/model.json")),
            model_hash(*read_model(folder_ / "without/model.json")));
}

TEST_F(EncoderCli, ReadingsOfAnotherDriveAreANoteAndThoseInAnotherUnitAnError) {
  auto other = made_.log;  // the same path at another speed
  for (std::size_t i = 0; i < other.readings.size(); ++i)
    other.readings[i].time_s = 0.001 * static_cast<double>(i);
  const auto ran = identify(other, "other");
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("the scale readings were not used along the path"));

  auto inches = made_.log;
  for (auto& r : inches.readings) r.q_m /= 25.4;
  EXPECT_EQ(identify(inches, "inches").exit, 3);
  EXPECT_EQ(identify(made_.log, "none", "--encoder-u-time-us 0").exit, 2);
}

}  // namespace
}  // namespace abbe::daemon
