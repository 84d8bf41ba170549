#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "abbe/daemon/control_protocol.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

class Control : public testing::Test {
 protected:
  Control()
      : directory_(std::filesystem::temp_directory_path() / ("abbe-control-" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(directory_);
  }
  ~Control() override { std::filesystem::remove_all(directory_); }
  [[nodiscard]] std::filesystem::path socket() const { return directory_ / "control.sock"; }

 private:
  std::filesystem::path directory_;
};

json echo(const json& request) {
  return {{"ok", true}, {"heard", request}};
}

TEST_F(Control, AnswersARequest) {
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_TRUE(server) << server.error().text;
  const auto answer = ask_daemon(socket(), {{"do", "status"}, {"path", {1.5, 2.5}}});
  ASSERT_TRUE(answer) << answer.error().text;
  EXPECT_EQ((*answer)["heard"]["path"], json({1.5, 2.5}));
}

TEST_F(Control, ARequestLargerThanAnyBufferArrivesWhole) {
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_TRUE(server);
  const std::string big(1u << 20, 'x');
  const auto answer = ask_daemon(socket(), {{"do", "status"}, {"text", big}});
  ASSERT_TRUE(answer) << answer.error().text;
  EXPECT_EQ((*answer)["heard"]["text"], big);
}

TEST_F(Control, ARefusalBecomesAnErrorWithItsText) {
  const auto server = ControlServer::open(socket(), [](const json&) {
    return json{{"ok", false}, {"error", "a session is running"}};
  });
  ASSERT_TRUE(server);
  const auto answer = ask_daemon(socket(), {{"do", "calibrate"}});
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::Refused);
  EXPECT_EQ(answer.error().text, "a session is running");
}

TEST_F(Control, AMemberOfTheWrongTypeIsAnAnswerNotACrash) {
  const auto server = ControlServer::open(socket(), [](const json& request) {
    return json{{"ok", true}, {"n", request.at("n").get<int>()}};
  });
  ASSERT_TRUE(server);
  const auto answer = ask_daemon(socket(), {{"do", "count"}, {"n", "three"}});
  ASSERT_FALSE(answer);
  EXPECT_NE(answer.error().text.find("count"), std::string::npos) << answer.error().text;
  EXPECT_TRUE(ask_daemon(socket(), {{"do", "count"}, {"n", 3}}));
}

TEST_F(Control, WithoutADaemonTheErrorNamesTheSocket) {
  const auto answer = ask_daemon(socket(), {{"do", "status"}});
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::Io);
  EXPECT_NE(answer.error().text.find(socket().string()), std::string::npos) << answer.error().text;
}

TEST_F(Control, TwoDaemonsOnOneSocketAreRefused) {
  const auto first = ControlServer::open(socket(), echo);
  ASSERT_TRUE(first);
  const auto second = ControlServer::open(socket(), echo);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().text.find("another daemon"), std::string::npos) << second.error().text;
  EXPECT_TRUE(ask_daemon(socket(), {{"do", "status"}}));
}

TEST_F(Control, ASocketLeftBehindIsReplaced) {
  { const auto dead = ControlServer::open(socket(), echo); }
  // What a killed daemon leaves: the file without anybody listening.
  std::filesystem::create_directories(socket().parent_path());
  ASSERT_EQ(::symlink("/nonexistent", socket().c_str()), 0);
  EXPECT_TRUE(ControlServer::open(socket(), echo));
}

}  // namespace
}  // namespace abbe::daemon
