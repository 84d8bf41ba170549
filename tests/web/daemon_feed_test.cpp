/// The thread that asks abbed for all pages.

#include "abbe/web/daemon_feed.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <string>

#include "web_folder.hpp"

namespace abbe::web {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

struct DaemonFeedTest : test::WebFolder {};

TEST_F(DaemonFeedTest, AThreadThatHangsIsAFaultAndAnAbbedThatDoesNotAnswerIsNone) {
  EventBoard board;
  const DaemonFeed feed{settings().value(), board, [] { return std::size_t{0}; },
                        [] { return std::string{}; }};
  const auto now = DaemonFeed::Clock::now();
  EXPECT_EQ(feed.fault(now), "");
  EXPECT_THAT(feed.fault(now + 60s), HasSubstr("abbed has not been asked for"));
}

TEST_F(DaemonFeedTest, ANoticeIsPostedOnceAndWithdrawnWhenItHasPassed) {
  EventBoard board;
  std::atomic<bool> expires{true};
  const DaemonFeed feed{
      settings().value(), board, [] { return std::size_t{1}; },
      [&expires] { return std::string{expires ? "the certificate expires" : ""}; }};
  EventBoard::Reader reader;
  const auto wait_for = [&](const std::string& text) {
    for (std::string seen; seen.find(text) == std::string::npos;) {
      const auto next = reader.next(board, 60s);
      ASSERT_TRUE(next && !next->empty()) << seen;
      seen += *next;
    }
  };
  ASSERT_NO_FATAL_FAILURE(
      wait_for("event: notice\ndata: {\"text\":\"the certificate expires\"}\n"));
  expires = false;
  wait_for("event: notice\ndata: {\"text\":\"\"}\n");
}

}  // namespace
}  // namespace abbe::web
