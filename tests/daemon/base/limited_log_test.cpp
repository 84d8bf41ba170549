#include "abbe/base/limited_log.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

namespace abbe::daemon {
namespace {

using ::testing::ElementsAre;

TEST(LimitedLog, CountsLinesOfASubjectBeyondItsLimitAndStatesTheirNumber) {
  std::vector<std::string> written;
  LimitedLog log([&](const std::string& line) { written.push_back(line); },
                 {.lines = 2, .period = std::chrono::minutes{1}});
  const LimitedLog::Clock::time_point now{std::chrono::hours{1}};
  for (int i = 0; i < 9; ++i) log.line("client", "client", now);
  log.line("other", "other", now);
  log.always("always");
  EXPECT_THAT(written, ElementsAre("client", "client", "other", "always"));

  written.clear();
  log.line("client", "later", now + std::chrono::minutes{1});
  log.line("client", "again", now + std::chrono::minutes{1});
  EXPECT_THAT(written, ElementsAre("later (7 more in between)", "again"));
}

}  // namespace
}  // namespace abbe::daemon
