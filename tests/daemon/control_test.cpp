#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

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

TEST_F(Control, ARefusalArrivesAsTheErrorItWas) {
  for (const auto code : {ErrorCode::DataInsufficient, ErrorCode::Usage, ErrorCode::BadInput, ErrorCode::Io,
                          ErrorCode::Refused}) {
    const auto server = ControlServer::open(socket(), [code](const json&) {
      return refusal({code, "a session is running"});
    });
    ASSERT_TRUE(server);
    const auto answer = ask_daemon(socket(), {{"do", "calibrate"}});
    ASSERT_FALSE(answer);
    EXPECT_EQ(answer.error().code, code);
    EXPECT_EQ(answer.error().text, "a session is running");
  }
}

TEST_F(Control, AnAnswerThatSaysNothingIsARefusal) {
  const auto server = ControlServer::open(socket(), [](const json&) { return json{{"ok", "perhaps"}}; });
  ASSERT_TRUE(server);
  const auto answer = ask_daemon(socket(), {{"do", "status"}});
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::Refused);
}

TEST_F(Control, AMemberOfTheWrongTypeIsAnAnswerNotACrash) {
  const auto server = ControlServer::open(socket(), [](const json& request) {
    return json{{"ok", true}, {"n", request.at("n").get<int>()}};
  });
  ASSERT_TRUE(server);
  const auto answer = ask_daemon(socket(), {{"do", "count"}, {"n", "three"}});
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::Usage);
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
  // What a killed daemon leaves: the file without anybody listening.
  const int dead = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(socket().native().size(), sizeof address.sun_path);
  std::strcpy(address.sun_path, socket().c_str());
  ASSERT_EQ(::bind(dead, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ::close(dead);
  EXPECT_TRUE(ControlServer::open(socket(), echo));
}

TEST_F(Control, AFileThatIsNoSocketIsLeftAlone) {
  std::ofstream{socket()} << "precious";
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_FALSE(server);
  EXPECT_NE(server.error().text.find("not a socket"), std::string::npos) << server.error().text;
  EXPECT_TRUE(std::filesystem::is_regular_file(socket()));
}

}  // namespace
}  // namespace abbe::daemon
