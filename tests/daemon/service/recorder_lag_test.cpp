#include "abbe/service/recorder_lag.hpp"

#include <gmock/gmock.h>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using testing::IsEmpty;
using testing::StartsWith;

TEST(RecorderLag, IsNoWarningBelowTwiceTheChunkPeriod) {
  EXPECT_THAT(text_of_lag(999ms, 500ms), IsEmpty());
}

TEST(RecorderLag, IsRoundedDownToSecondsOrMilliseconds) {
  EXPECT_THAT(text_of_lag(250ms, 100ms), StartsWith("the file is more than 200 ms behind"));
  EXPECT_THAT(text_of_lag(999ms, 100ms), StartsWith("the file is more than 500 ms behind"));
  EXPECT_THAT(text_of_lag(1s, 500ms), StartsWith("the file is more than 1 s behind"));
  EXPECT_THAT(text_of_lag(31s, 500ms), StartsWith("the file is more than 20 s behind"));
}

}  // namespace
}  // namespace abbe::daemon
