#include "abbe/sim/simulation.hpp"

#include <gmock/gmock.h>

#include "loopback_client.hpp"
#include "tracker_script.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;

SimulationSetup small_setup() {
  SimulationSetup setup;
  setup.path.vertices = {{{0, 0, 0}}, {{0.1, 0, 0}}, {{0.1, 0.1, 0}}};
  setup.tracker.emplace();
  setup.tracker->initialize_time = 100ms;
  setup.bus.emplace();
  return setup;
}

/// The complete simulation with a clock of the test, and a tracker client on a real socket.
class SimulationTest : public testing::Test {
 protected:
  void open(const SimulationSetup& setup) {
    simulation_ = Simulation::open(setup, now_).value();
    client_ = test::connected(SOCK_STREAM, simulation_->tracker()->port());
    test::readable(simulation_->tracker()->listener_fd());
    simulation_->poll(now_);
  }

  void tell(const emscon::Request& request) {
    std::array<std::byte, emscon::kMaxRequestSize> bytes{};
    test::send_bytes(client_, std::span(bytes).first(emscon::encode(request, bytes)));
    test::readable(simulation_->tracker()->client_fd());
    simulation_->poll(now_);
    run(300ms);
    ASSERT_TRUE(test::readable(client_.get()));  // the answer has arrived
  }

  void stream() {
    tell(emscon::Initialize{});
    tell(emscon::SetMeasurementMode{emscon::MeasurementMode::ContinuousTime});
    tell(emscon::StartMeasurement{});
  }

  void run(std::chrono::nanoseconds duration) {
    for (const HostTime end = now_ + duration; now_ < end;) simulation_->poll(now_ += 10ms);
  }

  HostTime now_{77s};
  std::unique_ptr<Simulation> simulation_;
  Socket client_;
};

TEST_F(SimulationTest, MachineStandsUntilTheTrackerStreams) {
  open(small_setup());
  run(60s);
  EXPECT_FALSE(simulation_->machine().started());
  EXPECT_EQ(simulation_->machine().motion(now_).q_m, Eigen::Vector3d(0, 0, 0));
}

TEST_F(SimulationTest, MachineMovesAfterItsStandstillAndStopsAtTheEnd) {
  open(small_setup());
  stream();
  const HostTime first_point = *simulation_->tracker()->device().first_stream();
  ASSERT_TRUE(simulation_->machine().started());
  EXPECT_EQ(*simulation_->machine().started(), first_point + 2s);
  EXPECT_EQ(simulation_->machine().motion(first_point + 2s).q_m, Eigen::Vector3d(0, 0, 0));
  run(2s + seconds_to_ns(simulation_->machine().path().duration_s()));
  EXPECT_LT((simulation_->machine().motion(now_).q_m - Eigen::Vector3d(0.1, 0.1, 0)).norm(), 1e-12);
}

TEST_F(SimulationTest, ConnectionLostDoesNotDriveThePathTwice) {
  open(small_setup());
  stream();
  const HostTime start = *simulation_->machine().started();
  client_ = test::connected(SOCK_STREAM, simulation_->tracker()->port());
  test::readable(simulation_->tracker()->listener_fd());
  run(10ms);
  stream();
  EXPECT_EQ(*simulation_->machine().started(), start);
}

TEST_F(SimulationTest, StartsByItselfWithoutStartWhenStreaming) {
  SimulationSetup setup = small_setup();
  setup.start_when_streaming = false;
  open(setup);
  EXPECT_EQ(*simulation_->machine().started(), HostTime{77s} + 2s);
}

TEST_F(SimulationTest, InjectsFaultsAtTheirTime) {
  SimulationSetup setup = small_setup();
  setup.start_when_streaming = false;
  setup.faults = {{FaultTarget::Tracker, {FaultKind::Disconnect, 1.0, 0.0, 0.0, 0}}};
  open(setup);
  run(2900ms);
  EXPECT_GE(simulation_->tracker()->client_fd(), 0);
  run(200ms);
  EXPECT_LT(simulation_->tracker()->client_fd(), 0);
}

TEST_F(SimulationTest, WithBusApartOnlyPollBusPollsTheBus) {
  SimulationSetup setup = small_setup();
  setup.start_when_streaming = false;
  setup.nodes = {{.node = 1, .axis = Axis::X}};
  setup.bus_apart = true;
  setup.faults = {{FaultTarget::Encoder, {FaultKind::BusOff, 1.0, 5.0, 0.0, 0}}};
  open(setup);
  const HostTime boot_due = simulation_->bus()->next_due();

  EXPECT_EQ(simulation_->next_bus_due(), boot_due);
  EXPECT_NE(simulation_->next_due(), boot_due);
  std::vector<pollfd> fds;
  simulation_->add_poll_fds(fds);
  for (const pollfd& fd : fds) EXPECT_NE(fd.fd, simulation_->bus()->fd());
  run(3100ms);
  EXPECT_EQ(simulation_->bus()->next_due(), boot_due);  // poll() did not poll the bus
  simulation_->poll_bus(now_);
  // The node has booted; the end of bus-off is due next.
  EXPECT_EQ(simulation_->next_bus_due(), now_ + 5s);
}

TEST_F(SimulationTest, NextDueIsInTheFutureAndNeverLate) {
  open(small_setup());
  stream();
  for (int i = 0; i < 50; ++i) {
    const HostTime due = simulation_->next_due();
    ASSERT_GT(due, now_);
    ASSERT_LT(due, now_ + 1s);  // a burst at least every 400 ms
    simulation_->poll(now_ = due);
  }
  EXPECT_GT(simulation_->tracker()->device().points_sent(), 40u * 150u);
}

TEST(Simulation, PathWithoutVertexIsRefused) {
  SimulationSetup setup = small_setup();
  setup.path.vertices.clear();
  EXPECT_FALSE(Simulation::open(setup, HostTime{}));
}

}  // namespace
}  // namespace abbe::sim
