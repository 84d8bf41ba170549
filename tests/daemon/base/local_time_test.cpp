/// Local time with its zone beside UTC.
#include "abbe/base/local_time.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "abbe/base/utc_text.hpp"

namespace abbe::daemon {
namespace {

/// The text in a process of its own with this TZ: the zone is read once.
void expect_in_zone(const char* zone, const char* utc, const std::string& expected) {
  const auto in_child = [&] {
    ::setenv("TZ", zone, 1);
    const std::string text = local_time_text(utc_from_text(utc).value());
    std::fprintf(stderr, "<%s>", text.c_str());
    std::_Exit(text == expected ? 0 : 1);
  };
  EXPECT_EXIT(in_child(), ::testing::ExitedWithCode(0), "") << expected;
}

TEST(LocalTime, HasItsZoneAndUtcBesideIt) {
  expect_in_zone("CET-1CEST,M3.5.0,M10.5.0/3", "2024-05-17T22:30:00.250000000Z",
                 "2024-05-18 00:30:00 +0200 (2024-05-17T22:30:00Z)");
  expect_in_zone("EST5", "2024-01-01T03:00:00.000000000Z",
                 "2023-12-31 22:00:00 -0500 (2024-01-01T03:00:00Z)");
}

TEST(LocalTime, IsUtcAloneWhereTheZoneIsUtc) {
  expect_in_zone("UTC0", "2024-05-17T22:30:00.250000000Z", "2024-05-17T22:30:00Z");
}

TEST(LocalTime, RoundsTowardsThePastBefore1970) {
  expect_in_zone("CET-1", "1969-12-31T23:30:00.500000000Z",
                 "1970-01-01 00:30:00 +0100 (1969-12-31T23:30:00Z)");
}

}  // namespace
}  // namespace abbe::daemon
