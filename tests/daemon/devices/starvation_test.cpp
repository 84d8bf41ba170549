// A stream that gives fewer samples than its device sends.
#include "abbe/devices/starvation.hpp"

#include <gmock/gmock.h>

#include "abbe/sim/tracker_model.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct StarvationTest : ::testing::Test {
  /// A second later, with so many more samples.
  std::string after(std::uint64_t more, double nominal_hz = 100.0, bool streaming = true) {
    now_ += 1s;
    samples_ += more;
    return starvation_.look(nominal_hz, streaming, now_, samples_);
  }
  Starvation starvation_;
  HostTime now_{10s};
  std::uint64_t samples_ = 0;
};

TEST_F(StarvationTest, IsReportedWithinTwoSeconds) {
  for (int i = 0; i < 5; ++i) EXPECT_THAT(after(100), IsEmpty());
  EXPECT_THAT(after(47), HasSubstr("47 % of the 100 samples per second arrive"));
  EXPECT_THAT(after(75), HasSubstr("61 %"));
  EXPECT_THAT(after(100), IsEmpty());
}

TEST_F(StarvationTest, OfAFifthIsReportedAfterTwoSeconds) {
  EXPECT_THAT(after(100), IsEmpty());
  EXPECT_THAT(after(75), IsEmpty());
  EXPECT_THAT(after(75), HasSubstr("75 %"));
}

TEST_F(StarvationTest, IsNotReportedForTheBurstsOfATracker) {
  auto next_burst = 300ms + 0ns;
  for (std::uint64_t burst = 0, second = 1; second < 200; ++second) {
    std::uint64_t points = 0;
    for (; next_burst < second * 1s; ++burst) {
      const auto interval = sim::burst_interval(1, burst);
      points += static_cast<std::uint64_t>(interval / 2ms);
      next_burst += interval;
    }
    EXPECT_THAT(after(points, 500.0), IsEmpty()) << second;
  }
}

TEST_F(StarvationTest, IsNotJudgedWhileTheDeviceDoesNotStream) {
  EXPECT_THAT(after(100), IsEmpty());
  EXPECT_THAT(after(0, 100.0, false), IsEmpty());
  EXPECT_THAT(after(10), IsEmpty()) << "it began to stream within this second";
  EXPECT_THAT(after(100), IsEmpty());
}

TEST_F(StarvationTest, IsNotJudgedWithoutANominalRate) {
  for (int i = 0; i < 5; ++i) EXPECT_THAT(after(1, 0.0), IsEmpty());
}

}  // namespace
}  // namespace abbe::daemon
