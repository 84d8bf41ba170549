/// abbed is killed, or its hub hangs, while a measuring machine moves at its command.

#include <gmock/gmock.h>
#include <poll.h>
#include <signal.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <thread>

#include "abbe/base/control_protocol.hpp"
#include "abbe/sim/ippdme_server.hpp"
#include "hung_hub.hpp"
#include "spine.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

/// The simulated machine on its port, in real time, in a thread of its own. It continues its
/// motion when the connection closes.
class MachineInAThread {
 public:
  explicit MachineInAThread(const sim::IppDmeOptions& options)
      : server_(
            sim::IppDmeServer::open(0, std::make_unique<sim::IppDmeDevice>(options, clock_.now()))
                .value()),
        thread_([this] { run(); }) {}
  MachineInAThread(const MachineInAThread&) = delete;
  MachineInAThread& operator=(const MachineInAThread&) = delete;
  ~MachineInAThread() {
    stop_ = true;
    thread_.join();
  }
  [[nodiscard]] std::uint16_t port() const { return server_.port(); }
  [[nodiscard]] bool moving() {
    const std::lock_guard lock{mutex_};
    return server_.device().moving();
  }
  [[nodiscard]] std::vector<std::string> heard() {
    const std::lock_guard lock{mutex_};
    const auto& all = server_.device().heard();
    return {all.begin(), all.end()};
  }
  [[nodiscard]] Eigen::Vector3d reading_m() {
    const std::lock_guard lock{mutex_};
    return server_.device().reading_m(clock_.now());
  }

 private:
  void run() {
    while (!stop_) {
      pollfd fds[2] = {{server_.listener_fd(), POLLIN, 0}, {server_.client_fd(), POLLIN, 0}};
      ::poll(fds, 2, 1);
      const std::lock_guard lock{mutex_};
      server_.poll(clock_.now());
    }
  }

  sim::SimClock clock_{1.0};
  sim::IppDmeServer server_;
  std::mutex mutex_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

bool moves_or_clears(const std::string& command) {
  return command.starts_with("GoTo") || command.starts_with("PtMeas") ||
         command.starts_with("Home") || command.starts_with("StartSession") ||
         command.starts_with("ClearAllErrors");
}

struct KilledWhileMoving : Spine {
  /// Slow: each of its motions takes a minute.
  static sim::IppDmeOptions slow_machine() {
    sim::IppDmeOptions machine;
    machine.machine.spheres = {{.centre_m = {0.05, 0.05, -0.15}, .radius_m = 12.5e-3}};
    machine.travel_speed_m_s = 3e-3;
    machine.home_time = std::chrono::minutes{1};
    return machine;
  }
  void start_at(MachineInAThread& machine, const std::string& more = {}) {
    write_configuration_of("[cmm]\nhost = \"127.0.0.1\"\nport = " + std::to_string(machine.port()) +
                           "\n" + more);
    write("abbed.toml", replaced(text_of(file("abbed.toml")), "\nspeed = [0-9]+", "\nspeed = 1"));
    ASSERT_NO_FATAL_FAILURE(start_abbed());
  }
  [[nodiscard]] auto ask(const json& request) const {
    return daemon::ask_daemon(directory_ / "run" / "control.sock", request);
  }
  /// Killed in `motion`, started again: the machine receives AbortE first, stops, and waits for
  /// a release.
  void expect_stopped_by_the_next_start(MachineInAThread& machine, const std::string& motion) {
    ASSERT_TRUE(machine.moving());
    abbed_->signal(SIGKILL);
    ASSERT_EQ(abbed_->wait_for_end(), -SIGKILL);
    const auto before = machine.heard().size();
    ASSERT_THAT(machine.heard().back(), testing::StartsWith(motion));
    ASSERT_TRUE(machine.moving()) << "nobody told it to stop";

    ASSERT_NO_FATAL_FAILURE(start_abbed());
    ASSERT_TRUE(eventually([&] { return machine.heard().size() > before; })) << abbed_->err();
    EXPECT_EQ(machine.heard()[before], "AbortE()");
    ASSERT_TRUE(eventually([&] { return stream("cmm")["state"] == "awaiting release"; }))
        << status().dump(1);
    EXPECT_FALSE(machine.moving());
    const Eigen::Vector3d stopped_m = machine.reading_m();
    EXPECT_FALSE(ask(touch_request())) << "nothing moves before a release";
    EXPECT_THAT(status()["release_awaited"]["reason"].get<std::string>(),
                HasSubstr("before the restart"));
    const auto heard = machine.heard();
    for (std::size_t i = before; i < heard.size(); ++i)
      EXPECT_FALSE(moves_or_clears(heard[i])) << heard[i];
    EXPECT_EQ(machine.reading_m(), stopped_m);

    const auto released = ask({{"do", "machine"}, {"release", true}});
    EXPECT_TRUE(released) << released.error().text;
    EXPECT_TRUE(eventually([&] { return machine.heard().back() != heard.back(); }));
  }
  /// The top of the sphere.
  static json touch_request() {
    return {
        {"do", "touch"},
        {"points",
         {{{"way", json::array()}, {"at_m", {0.05, 0.05, -0.1355}}, {"normal", {0.0, 0.0, 1.0}}}}}};
  }
};

TEST_F(KilledWhileMoving, ATouchIsAbortedByTheNextStart) {
  MachineInAThread machine{slow_machine()};
  ASSERT_NO_FATAL_FAILURE(start_at(machine));
  ASSERT_TRUE(eventually([&] { return ask(touch_request()).has_value(); })) << status().dump(1);
  ASSERT_TRUE(
      eventually([&] { return machine.moving() && machine.heard().back().starts_with("PtMeas"); }));
  expect_stopped_by_the_next_start(machine, "PtMeas");
}

TEST_F(KilledWhileMoving, HomingIsAbortedByTheNextStart) {
  auto options = slow_machine();
  options.homed = false;
  MachineInAThread machine{options};
  ASSERT_NO_FATAL_FAILURE(start_at(machine, "home = true\n"));
  ASSERT_TRUE(
      eventually([&] { return machine.moving() && machine.heard().back().starts_with("Home"); }));
  expect_stopped_by_the_next_start(machine, "Home");
}

TEST_F(KilledWhileMoving, AHubThatHangsDoesNotKeepTheEndFromStoppingTheMachine) {
  MachineInAThread machine{slow_machine()};
  ASSERT_NO_FATAL_FAILURE(start_at(machine));
  ASSERT_TRUE(eventually([&] { return ask(touch_request()).has_value(); })) << status().dump(1);
  ASSERT_TRUE(
      eventually([&] { return machine.moving() && machine.heard().back().starts_with("PtMeas"); }));
  const pid_t hub = thread_of(abbed_->pid(), "abbe-hub");
  ASSERT_GT(hub, 0);
  if (!stop_thread(hub)) GTEST_SKIP() << "ptrace is not allowed here";

  abbed_->signal(SIGTERM);
  EXPECT_TRUE(eventually([&] { return !machine.moving(); }, std::chrono::seconds{3}))
      << "before exit code 70";
  keep_stopped_to_the_end(hub);
  EXPECT_EQ(abbed_->wait_for_end(), 70);
  EXPECT_THAT(machine.heard(), testing::Contains("AbortE()"));
}

}  // namespace
}  // namespace abbe::test
