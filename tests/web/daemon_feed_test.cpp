/// The thread that asks abbed for all pages.

#include "abbe/web/daemon_feed.hpp"

#include <gmock/gmock.h>

#include "web_folder.hpp"

namespace abbe::web {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

struct DaemonFeedTest : test::WebFolder {};

TEST_F(DaemonFeedTest, AThreadThatHangsIsAFaultAndAnAbbedThatDoesNotAnswerIsNone) {
  EventBoard board;
  const DaemonFeed feed{settings().value(), board, [] { return std::size_t{0}; }};
  const auto now = DaemonFeed::Clock::now();
  EXPECT_EQ(feed.fault(now), "");
  EXPECT_THAT(feed.fault(now + 60s), HasSubstr("abbed has not been asked for"));
}

}  // namespace
}  // namespace abbe::web
