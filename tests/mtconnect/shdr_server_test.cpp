#include "abbe/mtconnect/shdr_server.hpp"

#include <gmock/gmock.h>

#include <memory>
#include <optional>
#include <vector>

#include "shdr_client.hpp"

namespace abbe::mtconnect {
namespace {

using namespace std::chrono_literals;
using test::ShdrClient;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr const char* kLine = "2024-05-17T08:30:00.123456Z|avail|AVAILABLE\n";
constexpr auto kPatience = 20s;  // only a failure waits it out

/// A server on loopback, whose cycles the test runs.
class ShdrServerTest : public ::testing::Test {
 protected:
  void listen(ShdrServerOptions options = {}) {
    options.port = 0;
    auto server = ShdrServer::listen(
        options, [] { return kLine; }, [this](std::string_view line) { log_.emplace_back(line); });
    ASSERT_TRUE(server) << server.error().text;
    server_.emplace(std::move(*server));
  }
  void cycle() { server_->cycle(1ms, -1); }
  /// Runs cycles until `seen` is true.
  template <class Condition>
  bool eventually(Condition seen) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (!seen()) {
      if (std::chrono::steady_clock::now() > deadline) return false;
      cycle();
    }
    return true;
  }
  std::unique_ptr<ShdrClient> connected() {
    auto client = std::make_unique<ShdrClient>(server_->port());
    EXPECT_TRUE(client->connected());
    EXPECT_TRUE(eventually([&] { return client->read() && client->view().events.size() == 1; }));
    return client;
  }
  /// A client that has begun its heartbeat.
  std::unique_ptr<ShdrClient> agent() {
    auto client = connected();
    EXPECT_TRUE(client->send("* PING\n"));
    EXPECT_TRUE(eventually([&] { return client->read() && !client->view().commands.empty(); }));
    return client;
  }
  /// The line of the log about the end of a client.
  [[nodiscard]] std::string end_of(const ShdrClient& client) const {
    for (const auto& line : log_)
      if (line.starts_with("client " + client.name() + ": disconnected")) return line;
    return {};
  }

  std::vector<std::string> log_;
  std::optional<ShdrServer> server_;
};

TEST_F(ShdrServerTest, GreetsEveryClientAndSendsToAll) {
  listen();
  const auto first = connected(), second = connected();
  server_->send("2024-05-17T08:30:00.123456Z|model_id|a1\n");
  for (const auto& client : {first.get(), second.get()})
    EXPECT_TRUE(
        eventually([&] { return client->read() && client->view().events.contains("model_id"); }));
}

TEST_F(ShdrServerTest, AnswersAPing) {
  listen({.heartbeat = 2500ms});
  const auto client = connected();
  ASSERT_TRUE(client->send("* PING\r\n* PING\n"));
  EXPECT_TRUE(eventually([&] { return client->read() && client->view().commands.size() == 2; }));
  EXPECT_THAT(client->view().commands, ::testing::Each("* PONG 2500"));
}

TEST_F(ShdrServerTest, AnswersAPingThatArrivesInPieces) {
  listen();
  const auto client = connected();
  ASSERT_TRUE(client->send("* PI"));
  cycle();
  ASSERT_TRUE(client->send("NG\n"));
  EXPECT_TRUE(eventually([&] { return client->read() && client->view().commands.size() == 1; }));
}

TEST_F(ShdrServerTest, IgnoresOtherLines) {
  listen();
  const auto client = connected();
  ASSERT_TRUE(client->send("GET / HTTP/1.1\n\n* device: x\n\x01\xFF\n* PING\n"));
  EXPECT_TRUE(eventually([&] { return client->read() && client->view().commands.size() == 1; }));
  EXPECT_EQ(server_->clients(), 1u);
}

TEST_F(ShdrServerTest, DisconnectsAClientThatNeverReadsByNameAndNoOther) {
  listen({.heartbeat = 60s, .unsent_bytes = 16u << 10, .socket_buffer_bytes = 4096});
  const auto reading = connected();
  ShdrClient mute(server_->port(), 4096);
  ASSERT_TRUE(eventually([&] { return server_->clients() == 2; }));

  int sent = 1;  // with the greeting
  EXPECT_TRUE(eventually([&] {
    server_->send(kLine);
    ++sent;
    return reading->read() && server_->clients() == 1;
  }));
  EXPECT_THAT(end_of(mute), HasSubstr("does not read"));
  EXPECT_EQ(end_of(*reading), "");
  EXPECT_TRUE(eventually([&] {
    return reading->read() && reading->view().lines_of.at("avail") == sent;
  })) << "the other client has lost lines";
}

TEST_F(ShdrServerTest, DisconnectsAClientThatHasReadNothingForTwoHeartbeats) {
  listen({.heartbeat = 20ms, .unsent_bytes = 64u << 20, .socket_buffer_bytes = 4096});
  ShdrClient mute(server_->port(), 4096);
  ASSERT_TRUE(eventually([&] { return server_->clients() == 1; }));
  for (int i = 0; i < 100'000; ++i) server_->send(kLine);
  EXPECT_TRUE(eventually([&] { return server_->clients() == 0; }));
  EXPECT_THAT(end_of(mute), HasSubstr("does not read"));
}

TEST_F(ShdrServerTest, DisconnectsAClientWhoseHeartbeatStops) {
  listen({.heartbeat = 20ms});
  const auto agent = connected(), terminal = connected();
  ASSERT_TRUE(agent->send("* PING\n"));
  EXPECT_TRUE(eventually([&] { return server_->clients() == 1; }));
  EXPECT_THAT(end_of(*agent), HasSubstr("no * PING for 0.04 s"));
  EXPECT_EQ(end_of(*terminal), "") << "a client that never sent a PING has no heartbeat";
}

TEST_F(ShdrServerTest, DisconnectsAClientThatFloodsIt) {
  listen();
  const auto other = connected();
  ShdrClient flooding(server_->port());
  std::string flood;
  for (int i = 0; i < 10'000; ++i) flood += "* PING\n";
  EXPECT_TRUE(eventually([&] {
    (void)flooding.send(flood);
    return !end_of(flooding).empty();
  }));
  EXPECT_THAT(end_of(flooding), HasSubstr("sends more than"));
  EXPECT_EQ(server_->clients(), 1u);
  EXPECT_EQ(end_of(*other), "");
}

TEST_F(ShdrServerTest, DisconnectsAClientThatSendsALineWithoutEnd) {
  listen();
  const auto client = connected();
  ASSERT_TRUE(client->send(std::string(3000, 'x')));
  EXPECT_TRUE(eventually([&] { return server_->clients() == 0; }));
  EXPECT_THAT(end_of(*client), HasSubstr("sends a line of more than"));
}

TEST_F(ShdrServerTest, RefusesMoreAgentsThanItsLimit) {
  listen({.clients = 2});
  auto first = agent();
  const auto second = agent();
  ShdrClient third(server_->port());
  EXPECT_TRUE(eventually([&] { return !third.read(); }));
  EXPECT_THAT(log_, Contains(AllOf(HasSubstr(third.name()), HasSubstr("refused: 2 agents"))));

  first.reset();
  EXPECT_TRUE(eventually([&] { return server_->clients() == 1; }));
  (void)connected();
}

TEST_F(ShdrServerTest, ReplacesTheOldestClientThatIsNotAnAgent) {
  listen({.clients = 3});
  const auto first = agent();
  const auto older = connected(), newer = connected();
  const auto fourth = agent();
  EXPECT_EQ(server_->clients(), 3u);
  EXPECT_THAT(end_of(*older), HasSubstr("never sent a * PING"));
  for (const auto* stays : {first.get(), newer.get(), fourth.get()}) EXPECT_EQ(end_of(*stays), "");
}

TEST_F(ShdrServerTest, ReportsAClientThatCloses) {
  listen();
  auto client = connected();
  const std::string name = client->name();
  client.reset();
  EXPECT_TRUE(eventually([&] { return server_->clients() == 0; }));
  EXPECT_THAT(log_, Contains(AllOf(HasSubstr(name), HasSubstr("closed the connection"))));
}

TEST_F(ShdrServerTest, RefusesAPortInUse) {
  listen();
  const auto second = ShdrServer::listen({.port = server_->port()}, {}, {});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, daemon::ErrorCode::Io);
  EXPECT_THAT(second.error().text,
              AllOf(HasSubstr("127.0.0.1"), HasSubstr(std::to_string(server_->port())),
                    HasSubstr("another process listens there")));
}

TEST_F(ShdrServerTest, RefusesAnAddressThatIsNotNumeric) {
  const auto server = ShdrServer::listen({.address = "localhost"}, {}, {});
  ASSERT_FALSE(server);
  EXPECT_EQ(server.error().code, daemon::ErrorCode::Usage);
}

TEST_F(ShdrServerTest, RefusesAnAddressOfAnotherComputer) {
  const auto server = ShdrServer::listen({.address = "192.0.2.1", .port = 0}, {}, {});
  ASSERT_FALSE(server);
  EXPECT_THAT(server.error().text, HasSubstr("192.0.2.1"));
}

}  // namespace
}  // namespace abbe::mtconnect
