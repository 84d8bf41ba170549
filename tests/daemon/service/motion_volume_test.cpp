/// Places that could become a motion of the measuring machine: all of a request are checked before
/// any is sent.

#include <gmock/gmock.h>

#include <limits>

#include "abbe/config/config.hpp"
#include "abbe/service/motion_volume.hpp"
#include "abbe/service/touch_service.hpp"
#include "config_tables.hpp"

namespace abbe::daemon {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinite = std::numeric_limits<double>::infinity();

Config machine_with(const std::string& cmm) {
  const auto config = parse_config(
      to_toml(config_tables::half_metre_mill()) + "[cmm]\nhost = \"127.0.0.1\"\n" + cmm,
      "abbed.toml");
  EXPECT_TRUE(config) << config.error().details.front();
  return config ? *config : Config{};
}

std::string fault_of(const std::string& cmm) {
  const auto config = parse_config(
      to_toml(config_tables::half_metre_mill()) + "[cmm]\nhost = \"127.0.0.1\"\n" + cmm,
      "abbed.toml");
  return config ? "" : config.error().details.front();
}

struct MotionVolumeTest : testing::Test {
  MotionVolume volume{{0.0, 0.0, -0.4}, {0.5, 0.4, 0.0}, {"[axes.X] travel", "Y", "Z"}};
  TouchRequest good{.way = {{.position_m = {0.1, 0.1, 0.0}, .touch = false}},
                    .point = {.position_m = {0.1, 0.1, -0.2}}};

  [[nodiscard]] std::string refusal(const std::vector<TouchRequest>& touches,
                                    const std::vector<drivers::ProbePoint>& leave = {}) const {
    const auto job = touch_job(volume, touches, leave);
    if (job) return "";
    EXPECT_EQ(job.error().code, ErrorCode::Refused);
    return job.error().text;
  }
};

TEST_F(MotionVolumeTest, AcceptsPlacesUpToTheLimits) {
  good.point.position_m = {0.5, 0.4, -0.4};
  EXPECT_EQ(refusal({good}, {{.position_m = {0.0, 0.0, 0.0}, .touch = false}}), "");
}

TEST_F(MotionVolumeTest, NamesPointAxisValueAndLimit) {
  TouchRequest far = good;
  far.point.position_m = {5.0, 0.1, -50.0};
  EXPECT_THAT(refusal({good, far}),
              AllOf(HasSubstr("nothing of it was sent"), HasSubstr("point 2 of 2"),
                    HasSubstr("X 5000 mm is above 500 mm ([axes.X] travel)")));
}

TEST_F(MotionVolumeTest, ChecksTheWayToATouchAndTheWayOut) {
  TouchRequest high = good;
  high.way.push_back({.position_m = {0.1, 0.1, 0.001}, .touch = false});
  EXPECT_THAT(refusal({high}), AllOf(HasSubstr("point 1 of 1, place 2 of 2 on the way to it"),
                                     HasSubstr("Z 1 mm is above 0 mm")));
  EXPECT_THAT(
      refusal({good}, {{.position_m = {0.1, -0.2, 0.0}, .touch = false}}),
      AllOf(HasSubstr("place 1 of 1 on the way out"), HasSubstr("Y -200 mm is below 0 mm")));
}

TEST_F(MotionVolumeTest, RefusesWhatIsNotFinite) {
  for (const double bad : {kNan, kInfinite, -kInfinite, 1e16}) {
    TouchRequest request = good;
    request.way[0].position_m[2] = bad;
    EXPECT_THAT(refusal({request}), HasSubstr("place 1 of 1")) << bad;
  }
}

TEST_F(MotionVolumeTest, RefusesANormalThatIsNoUnitVector) {
  for (const std::array<double, 3> normal :
       {std::array{0.0, 0.0, 0.0}, std::array{0.0, 0.0, 2.0}, std::array{kNan, 0.0, 1.0},
        std::array{0.0, 0.0, kInfinite}, std::array{0.6, 0.0, 0.79}}) {
    good.point.normal = normal;
    EXPECT_THAT(refusal({good}), AllOf(HasSubstr("its normal"), HasSubstr("unit vector")));
  }
  good.point.normal = {0.6, 0.0, -0.8};
  EXPECT_EQ(refusal({good}), "");
}

TEST_F(MotionVolumeTest, CountsTheFurtherFaults) {
  TouchRequest far = good;
  far.point.position_m[0] = 5.0;
  EXPECT_THAT(refusal({far, good, far, far}), HasSubstr("(and 2 more places)"));
}

TEST(MotionVolumeOfAConfiguration, IsTheTravelOfTheAxes) {
  const Config config = machine_with("");
  const MotionVolume volume = motion_volume(config);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(volume.min_m[i], config.machine.axes[i].min);
    EXPECT_EQ(volume.max_m[i], config.machine.axes[i].max);
  }
  EXPECT_EQ(volume.limited_by[2], "[axes.Z] travel");
}

TEST(MotionVolumeOfAConfiguration, MayBeSetForTheMeasuringMachine) {
  const MotionVolume volume = motion_volume(
      machine_with("volume_min_mm = [-100, 0, -700]\nvolume_max_mm = [600, 500, 100]\n"));
  EXPECT_THAT(volume.min_m, testing::ElementsAre(-0.1, 0.0, -0.7));
  EXPECT_THAT(volume.max_m, testing::ElementsAre(0.6, 0.5, 0.1));
  EXPECT_EQ(volume.limited_by[0], "[cmm] volume");
}

TEST(MotionVolumeOfAConfiguration, IsRefusedIfItIsIncompleteOrEmpty) {
  EXPECT_THAT(fault_of("volume_min_mm = [0, 0, 0]\n"), HasSubstr("three numbers"));
  EXPECT_THAT(fault_of("volume_min_mm = [0, 0]\nvolume_max_mm = [1, 1]\n"),
              HasSubstr("three numbers"));
  EXPECT_THAT(fault_of("volume_min_mm = [0, 0, 0]\nvolume_max_mm = [1, 1, 0]\n"),
              HasSubstr("above volume_min_mm"));
}

}  // namespace
}  // namespace abbe::daemon
