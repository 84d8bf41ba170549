#include "abbe/sim/tracker_server.hpp"

#include <gmock/gmock.h>

#include "loopback_client.hpp"
#include "tracker_script.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;

class TrackerServerTest : public testing::Test {
 protected:
  static TrackerServer open(const VirtualMachine& machine, HostTime now) {
    return TrackerServer::open(0, std::make_unique<TrackerDevice>(TrackerOptions{}, machine, now))
        .value();
  }

  Socket connect() {
    Socket client = test::connected(SOCK_STREAM, server_.port());
    test::readable(server_.listener_fd());
    server_.poll(now_);
    return client;
  }

  std::vector<std::byte> ask(const Socket& client, const emscon::Request& request) {
    std::array<std::byte, emscon::kMaxRequestSize> bytes{};
    test::send_bytes(client, std::span(bytes).first(emscon::encode(request, bytes)));
    test::readable(server_.client_fd());
    server_.poll(now_);
    server_.poll(now_ += 10ms);
    return test::receive_bytes(client);
  }

  HostTime now_{50s};
  VirtualMachine machine_ = test::standing_machine();
  TrackerServer server_ = open(machine_, now_);
};

TEST_F(TrackerServerTest, AnswersOverARealSocket) {
  const Socket client = connect();
  const std::vector<std::byte> bytes = ask(client, emscon::GetSystemStatus{});
  const auto answer = emscon::decode_answer(bytes);
  ASSERT_TRUE(answer);
  EXPECT_EQ(std::get<emscon::SystemStatusAnswer>(*answer).laser, emscon::LaserStatus::Ready);
}

TEST_F(TrackerServerTest, StreamsBurstsOverARealSocket) {
  const Socket client = connect();
  ask(client, emscon::SetMeasurementMode{emscon::MeasurementMode::ContinuousTime});
  std::array<std::byte, emscon::kMaxRequestSize> bytes{};
  test::send_bytes(client, std::span(bytes).first(emscon::encode(emscon::Initialize{}, bytes)));
  test::readable(server_.client_fd());
  server_.poll(now_);
  server_.poll(now_ += 3s);
  test::receive_bytes(client);
  ask(client, emscon::StartMeasurement{});
  server_.poll(now_ += 400ms);
  const std::vector<std::byte> burst = test::receive_bytes(client);
  const auto result = emscon::MultiResult::from(burst);

  ASSERT_TRUE(result);
  EXPECT_GT(result->size(), 140u);
}

TEST_F(TrackerServerTest, RefusesASecondClientAndKeepsTheFirst) {
  const Socket first = connect();
  const Socket second = connect();
  const auto refusal = emscon::decode(test::receive_bytes(second));
  ASSERT_TRUE(refusal);
  EXPECT_EQ(std::get<emscon::ErrorResponse>(*refusal).status,
            emscon::Status::MultipleConnectionsNotAllowed);
  EXPECT_TRUE(test::receive_bytes(second).empty());
  EXPECT_EQ(ask(first, emscon::SetUnits{}).size(), 16u);
}

TEST_F(TrackerServerTest, AcceptsTheNextClientAfterTheFirstDisconnected) {
  connect().close();
  const Socket next = connect();
  EXPECT_EQ(ask(next, emscon::SetUnits{}).size(), 16u);
}

TEST_F(TrackerServerTest, RebootClosesTheConnectionAndRefusesClientsUntilItEnds) {
  const Socket client = connect();
  server_.device().inject({FaultKind::Reboot, 0.0, 5.0, 0.0, 0}, now_);
  server_.poll(now_);
  const auto closing = emscon::decode(test::receive_bytes(client));
  EXPECT_EQ(std::get<emscon::StatusChange>(*closing).event, emscon::Event::ServerClosing);
  EXPECT_TRUE(test::receive_bytes(client).empty());
  const Socket early = connect();
  EXPECT_TRUE(test::receive_bytes(early).empty());
  now_ += 5s;
  const Socket again = connect();
  const auto started = emscon::decode(test::receive_bytes(again));
  EXPECT_EQ(std::get<emscon::StatusChange>(*started).event, emscon::Event::ServerStarted);
}

TEST_F(TrackerServerTest, PortInUseIsAClearError) {
  const auto second = TrackerServer::open(
      server_.port(), std::make_unique<TrackerDevice>(TrackerOptions{}, machine_, now_));
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Io);
  EXPECT_THAT(second.error().text, testing::HasSubstr(std::to_string(server_.port())));
}

}  // namespace
}  // namespace abbe::sim
