#include "abbe/base/utc_text.hpp"

#include <gtest/gtest.h>

namespace abbe::daemon {
namespace {

TEST(UtcText, ReadsBackWhatItWrites) {
  for (const char* text : {"2024-05-17T08:30:00.123456789Z", "1969-12-31T23:59:59.999999999Z",
                           "1678-01-01T00:00:00.000000000Z", "2261-12-31T23:59:59.999999999Z"}) {
    const auto time = utc_from_text(text);
    ASSERT_TRUE(time) << text;
    EXPECT_EQ(to_text(*time), text);
  }
}

TEST(UtcText, RefusesYearsThatNanosecondsDoNotHold) {
  EXPECT_FALSE(utc_from_text("9648-01-01T00:00:00.000000000Z"));
  EXPECT_FALSE(utc_from_text("1677-12-31T00:00:00.000000000Z"));
  EXPECT_FALSE(utc_from_text("2262-01-01T00:00:00.000000000Z"));
}

TEST(UtcText, RefusesAnyOtherForm) {
  for (const char* text : {"2024-05-17T08:30:00.123456789z", "2024- 5-17T08:30:00.123456789Z",
                           "2024-05-17T08:30:00.+23456789Z", "2024-02-30T08:30:00.000000000Z",
                           "2024-05-17T24:00:00.000000000Z", "-024-05-17T08:30:00.123456789Z"})
    EXPECT_FALSE(utc_from_text(text)) << text;
}

}  // namespace
}  // namespace abbe::daemon
