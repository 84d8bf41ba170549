/// The thread that asks abbed for all pages.

#include "abbe/web/daemon_feed.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <string>

#include "web_folder.hpp"

namespace abbe::web {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct DaemonFeedTest : test::WebFolder {};

TEST_F(DaemonFeedTest, AThreadThatHangsIsAFaultAndAnAbbedThatDoesNotAnswerIsNone) {
  EventBoard board;
  const DaemonFeed feed{settings().value(), board, [] { return std::size_t{0}; },
                        [] { return std::string{}; }};
  const auto now = DaemonFeed::Clock::now();
  EXPECT_EQ(feed.fault(now), "");
  EXPECT_THAT(feed.fault(now + 60s), HasSubstr("abbed has not been asked for"));
}

/// Reads events until `text` is among them, and returns all of them.
std::string events_until(EventBoard& board, EventBoard::Reader& reader, const std::string& text) {
  std::string seen;
  while (seen.find(text) == std::string::npos) {
    const auto next = reader.next(board, 60s);
    if (!next || next->empty()) return seen;
    seen += *next;
  }
  return seen;
}

TEST_F(DaemonFeedTest, ANoticeIsPostedOnceAndWithdrawnWhenItHasPassed) {
  constexpr int kMoreCycles = 3;
  EventBoard board;
  std::atomic<bool> is_read{false};
  std::atomic<int> calls{0};  // after the first event was read
  const DaemonFeed feed{settings().value(), board, [] { return std::size_t{1}; },
                        [&] {
                          const bool expires = !is_read || ++calls < kMoreCycles;
                          return std::string{expires ? "the certificate expires" : ""};
                        }};
  EventBoard::Reader reader;
  const std::string posted = "event: notice\ndata: {\"text\":\"the certificate expires\"}\n";
  EXPECT_THAT(events_until(board, reader, posted), HasSubstr(posted));
  is_read = true;
  const std::string withdrawn = "event: notice\ndata: {\"text\":\"\"}\n";
  const std::string later = events_until(board, reader, withdrawn);
  EXPECT_THAT(later, AllOf(HasSubstr(withdrawn), Not(HasSubstr(posted))));
}

TEST_F(DaemonFeedTest, ThatThereIsNoNoticeIsPostedForPagesThatShowAnEarlierOne) {
  EventBoard board;
  const DaemonFeed feed{settings().value(), board, [] { return std::size_t{1}; },
                        [] { return std::string{}; }};
  EventBoard::Reader reader;
  const std::string none = "event: notice\ndata: {\"text\":\"\"}\n";
  EXPECT_THAT(events_until(board, reader, none), HasSubstr(none));
}

}  // namespace
}  // namespace abbe::web
