#include "abbe/mtconnect/shdr_feed.hpp"

#include <gmock/gmock.h>

#include <sstream>

#include "shdr_client.hpp"
#include "status_example.hpp"

namespace abbe::mtconnect {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Key;
using ::testing::UnorderedElementsAre;

class ShdrFeedTest : public ::testing::Test {
 protected:
  /// The lines of an update, which the agent takes.
  std::string update(const nlohmann::json& status) {
    const auto lines = feed_.update(observations_of(status), now_);
    take(lines);
    return lines;
  }
  void take(const std::string& lines) {
    std::istringstream in(lines);
    for (std::string line; std::getline(in, line);) agent_.take(line);
  }

  protocol::UtcTime now_{std::chrono::hours{500'000}};
  ShdrFeed feed_;
  test::ShdrView agent_;
};

TEST_F(ShdrFeedTest, BeginsUnavailable) {
  take(feed_.everything(now_));
  for (const char* name : {"avail", "process_state", "model_id", "u_volume", "message"})
    EXPECT_EQ(agent_.events[name], "UNAVAILABLE") << name;
  for (const char* name : {"devices", "system", "calibration"})
    EXPECT_EQ(agent_.level(name), "UNAVAILABLE") << name;
}

TEST_F(ShdrFeedTest, SendsOnlyWhatChanged) {
  auto status = test::status();
  EXPECT_THAT(update(status), HasSubstr("|avail|AVAILABLE\n"));
  EXPECT_EQ(update(status), "");
  status["session"] = {
      {"id", 4}, {"state", "warming"}, {"method", "mfb"}, {"reason", "waits for | the machine"}};
  agent_.lines_of.clear();
  update(status);

  EXPECT_THAT(agent_.lines_of, UnorderedElementsAre(Key("process_state"), Key("process_id"),
                                                    Key("process_kind"), Key("message")));
  EXPECT_EQ(agent_.events["message"], "waits for | the machine");
  EXPECT_EQ(agent_.codes["message"], "warming");
}

TEST_F(ShdrFeedTest, GivesALateClientWhatAnEarlierOneHas) {
  auto status = test::status();
  update(status);
  status["streams"][0] = test::stream("tracker", "connecting", false, "cable out");
  update(status);
  test::ShdrView early = std::exchange(agent_, {});
  take(feed_.everything(now_));
  EXPECT_EQ(agent_.events, early.events);
  EXPECT_EQ(agent_.level("devices"), "FAULT");
  EXPECT_EQ(agent_.conditions["devices"]["tracker"].text,
            early.conditions["devices"]["tracker"].text);
}

TEST_F(ShdrFeedTest, EndsOneConditionOfSeveral) {
  auto status = test::status();
  update(status);
  status["streams"][0]["connected"] = false;
  status["streams"][1]["connected"] = false;
  update(status);
  EXPECT_THAT(agent_.conditions["devices"], UnorderedElementsAre(Key("tracker"), Key("encoder")));
  status["streams"][0]["connected"] = true;
  update(status);

  EXPECT_THAT(agent_.conditions["devices"], ElementsAre(Key("encoder")));
  status["streams"][1]["connected"] = true;
  update(status);
  EXPECT_EQ(agent_.level("devices"), "NORMAL");
}

TEST_F(ShdrFeedTest, IsUnavailableWithoutTheDaemonAndComesBack) {
  auto status = test::status();
  status["streams"][0]["connected"] = false;
  update(status);
  take(feed_.update(nothing_observed(), now_));
  EXPECT_EQ(agent_.events["avail"], "UNAVAILABLE");
  EXPECT_EQ(agent_.level("devices"), "UNAVAILABLE");
  update(status);
  EXPECT_EQ(agent_.events["avail"], "AVAILABLE");
  EXPECT_EQ(agent_.level("devices"), "FAULT");
  EXPECT_EQ(agent_.level("system"), "NORMAL");
}

TEST_F(ShdrFeedTest, SendsATextThatChangesOftenOnceInItsPeriod) {
  auto status = test::status();
  status["streams"][0]["connected"] = false;
  update(status);
  agent_.lines_of.clear();
  int tries = 0;
  for (auto passed = 1s; passed <= 3 * ShdrFeed::kTextPeriod; passed += 1s) {
    now_ += 1s;
    status["streams"][0]["last_fault"] = "no reply, try " + std::to_string(++tries);
    update(status);
  }
  EXPECT_EQ(agent_.lines_of["devices"], 3);
  EXPECT_THAT(agent_.conditions["devices"]["tracker"].text,
              HasSubstr("try " + std::to_string(tries)));
}

TEST_F(ShdrFeedTest, SendsAChangeOfTheLevelAtOnce) {
  auto status = test::status();
  status["streams"][0]["connected"] = false;
  update(status);
  now_ += 1ms;
  status["streams"][0] = test::stream("tracker", "streaming", true, "", "no beam");
  update(status);
  EXPECT_EQ(agent_.conditions["devices"]["tracker"].level, "WARNING");
  EXPECT_EQ(agent_.conditions["devices"]["tracker"].text, "no beam");
}

TEST_F(ShdrFeedTest, ContinuesAfterTheClockWasSetBack) {
  auto status = test::status();
  status["streams"][0]["connected"] = false;
  update(status);
  now_ -= 24h;
  status["streams"][0]["last_fault"] = "another";
  EXPECT_THAT(update(status), HasSubstr("another"));
}

}  // namespace
}  // namespace abbe::mtconnect
