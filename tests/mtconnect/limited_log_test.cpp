#include "abbe/mtconnect/limited_log.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

namespace abbe::mtconnect {
namespace {

using ::testing::SizeIs;

TEST(LimitedLog, CountsLinesBeyondItsLimitAndStatesTheirNumber) {
  std::vector<std::string> written;
  LimitedLog log([&](std::string_view line) { written.emplace_back(line); });
  LimitedLog::Clock::time_point now{std::chrono::hours{1}};
  constexpr int kOmitted = 7;
  for (std::uint32_t i = 0; i < LimitedLog::kLines + kOmitted; ++i) log.line("client", now);
  EXPECT_THAT(written, SizeIs(LimitedLog::kLines));

  written.clear();
  log.line("later", now + LimitedLog::kPeriod);
  ASSERT_THAT(written, SizeIs(2));
  EXPECT_TRUE(written[0].starts_with(std::to_string(kOmitted))) << written[0];
  EXPECT_EQ(written[1], "later");
}

}  // namespace
}  // namespace abbe::mtconnect
