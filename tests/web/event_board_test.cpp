#include "abbe/web/event_board.hpp"

#include <gmock/gmock.h>

#include <thread>

namespace abbe::web {
namespace {

using namespace std::chrono_literals;
using ::testing::Optional;

TEST(EventBoard, APageReceivesTheLatestEventOfEachTopicOnce) {
  EventBoard board;
  EventBoard::Reader reader;
  board.post(Topic::Live, "[1]");
  board.post(Topic::Live, "[2]");
  board.post(Topic::Source, "{}");
  EXPECT_THAT(reader.next(board, 0ms),
              Optional(std::string{"event: source\ndata: {}\n\nevent: live\ndata: [2]\n\n"}));
  EXPECT_THAT(reader.next(board, 0ms), Optional(std::string{}));
}

TEST(EventBoard, APageThatOpensLaterReceivesWhatIsCurrent) {
  EventBoard board;
  board.post(Topic::Status, "{}");
  EventBoard::Reader late;
  EXPECT_THAT(late.next(board, 0ms), Optional(std::string{"event: status\ndata: {}\n\n"}));
}

TEST(EventBoard, WakesAWaitingPageForAnEventAndForTheEnd) {
  EventBoard board;
  EventBoard::Reader reader;
  std::thread posting([&] { board.post(Topic::Live, "[]"); });
  EXPECT_THAT(reader.next(board, 60s), Optional(std::string{"event: live\ndata: []\n\n"}));
  posting.join();
  std::thread closing([&] { board.close(); });
  EXPECT_EQ(reader.next(board, 60s), std::nullopt);
  closing.join();
}

}  // namespace
}  // namespace abbe::web
