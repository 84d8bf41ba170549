/// The state of a measuring machine is written by a thread of its own: a disk that does not answer
/// keeps neither AbortE nor a stop from the machine, and a motion waits for it.

#include <gmock/gmock.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <string>
#include <thread>

#include "abbe/config/config.hpp"
#include "abbe/devices/device_set.hpp"
#include "abbe/sim/ippdme_server.hpp"
#include "config_tables.hpp"
#include "failing_disk.hpp"
#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using drivers::IppStopOutcome;
using testing::HasSubstr;

/// The simulated machine, served by the thread of the test.
class ServedMachine {
 public:
  ServedMachine()
      : server_(sim::IppDmeServer::open(
                    0, std::make_unique<sim::IppDmeDevice>(slow_machine(), clock_.now()))
                    .value()) {}
  [[nodiscard]] std::uint16_t port() const { return server_.port(); }
  [[nodiscard]] bool moving() const { return server_.device().moving(); }
  [[nodiscard]] bool heard(std::string_view start) const {
    return std::ranges::any_of(server_.device().heard(),
                               [&](const std::string& c) { return c.starts_with(start); });
  }
  void press_emergency_stop() {
    server_.device().press_emergency_stop(clock_.now(), clock_.now() + 1h);
  }
  /// Serves until `seen`; false after 20 s.
  template <class Seen>
  bool serve_until(Seen seen) {
    for (const auto end = std::chrono::steady_clock::now() + 20s; !seen();
         std::this_thread::sleep_for(1ms)) {
      if (std::chrono::steady_clock::now() > end) return false;
      server_.poll(clock_.now());
    }
    return true;
  }

 private:
  /// Slow: the motion of these tests takes a minute.
  static sim::IppDmeOptions slow_machine() {
    sim::IppDmeOptions machine;
    machine.travel_speed_m_s = 2e-3;
    return machine;
  }
  sim::SimClock clock_{1.0};
  sim::IppDmeServer server_;
};

struct MachineHoldWriting : testing::Test {
  MachineHoldWriting() {
    auto config = parse_config(
        to_toml(config_tables::half_metre_mill()) +
            "[cmm]\nhost = \"127.0.0.1\"\nport = " + std::to_string(machine_.port()) + "\n",
        "abbed.toml");
    EXPECT_TRUE(config) << config.error().details.front();
    config_ = *config;
    config_.of<CmmConfig>()->command_timeout = 500ms;
    config_.daemon.data_dir = folder_.path() / "data";
  }
  [[nodiscard]] fs::path file() const { return config_.daemon.data_dir / "machine-hold"; }
  /// Starts the devices; with `stall`, fsync() of their threads does not return before
  /// disk_answers().
  void start(bool stall) {
    std::thread{[&] {
      if (stall) {
        listener_ = test::make_stall(SYS_fsync);
        ASSERT_GE(listener_, 0) << "no seccomp filter";
      }
      auto started = DeviceSet::start(config_, time_);
      ASSERT_TRUE(started) << started.error().text;
      devices_.emplace(std::move(*started));
    }}.join();
    ASSERT_TRUE(devices_);
    ASSERT_TRUE(machine_.serve_until([&] { return health().state == "ready"; }))
        << health().last_fault;
  }
  void disk_answers() {
    if (listener_ >= 0) ::close(std::exchange(listener_, -1));
  }
  ~MachineHoldWriting() override {
    disk_answers();
    devices_.reset();
  }
  [[nodiscard]] drivers::DeviceStatus health() {
    return devices_->health(time_.now()).front().status;
  }
  void go() {
    const drivers::ProbePoint place{.position_m = {0.1, 0.1, 0.0}, .touch = false};
    devices_->measure(std::span{&place, 1});
  }
  void start_moving() {
    start(false);
    go();
    ASSERT_TRUE(machine_.serve_until([&] { return machine_.moving(); })) << health().last_fault;
  }
  [[nodiscard]] IppStopOutcome outcome_of_a_stop() {
    const auto number = devices_->stop_machine().value_or(0);
    EXPECT_TRUE(machine_.serve_until([&] {
      const auto stop = devices_->machine_stop();
      return stop.number >= number && stop.outcome != IppStopOutcome::Pending;
    }));
    return devices_->machine_stop().outcome;
  }

  TemporaryFolder folder_;
  ServedMachine machine_;
  drivers::MonotonicTime time_;
  Config config_;
  int listener_ = -1;
  std::optional<DeviceSet> devices_;
};

TEST_F(MachineHoldWriting, AMotionIsOnTheDiskBeforeItIsSent) {
  ASSERT_NO_FATAL_FAILURE(start_moving());
  EXPECT_EQ(test::text_of(file()), "a motion is under way\n");
}

TEST_F(MachineHoldWriting, AMotionWaitsForADiskThatDoesNotAnswerAndAStopDoesNot) {
  ASSERT_NO_FATAL_FAILURE(start(true));
  go();
  ASSERT_TRUE(machine_.serve_until([&] { return health().state == "storing"; }))
      << health().last_fault;
  EXPECT_EQ(outcome_of_a_stop(), IppStopOutcome::Stopped);
  EXPECT_FALSE(machine_.heard("GoTo"));
  EXPECT_TRUE(machine_.serve_until([&] {
    return health().condition.find("not saved yet") != std::string::npos;
  })) << health().condition;
}

TEST_F(MachineHoldWriting, AbortIsSentWhileTheWriterWaitsForTheDisk) {
  // The file as a killed abbed left it: what the writer has to write is another state.
  fs::create_directories(file().parent_path());
  test::write_text(file(), "a motion is under way\n");
  std::thread{[&] {
    listener_ = test::make_stall(SYS_fsync);
    ASSERT_GE(listener_, 0) << "no seccomp filter";
    auto started = DeviceSet::start(config_, time_);
    ASSERT_TRUE(started) << started.error().text;
    devices_.emplace(std::move(*started));
  }}.join();
  ASSERT_TRUE(devices_);
  ASSERT_TRUE(machine_.serve_until([&] { return machine_.heard("AbortE"); }))
      << health().last_fault;
  EXPECT_TRUE(machine_.serve_until([&] { return health().state == "awaiting release"; }));
  EXPECT_TRUE(machine_.serve_until([&] {
    return health().condition.find("not saved yet") != std::string::npos;
  })) << health().condition;
}

TEST_F(MachineHoldWriting, AHoldThatCannotBeWrittenIsNamedAndWrittenLater) {
  ASSERT_NO_FATAL_FAILURE(start_moving());
  const auto in_the_way = file().string() + "." + std::to_string(::getpid()) + ".new";
  fs::create_directory(in_the_way);  // the new file cannot be created
  fs::create_directory(in_the_way + "/full");
  machine_.press_emergency_stop();
  ASSERT_TRUE(machine_.serve_until([&] { return machine_.heard("AbortE"); }));
  ASSERT_TRUE(machine_.serve_until([&] {
    return health().condition.find("would not await a release") != std::string::npos;
  })) << health().condition;
  fs::remove_all(in_the_way);
  ASSERT_TRUE(machine_.serve_until([&] { return health().condition.empty(); }))
      << health().condition;
  EXPECT_THAT(test::text_of(file()), HasSubstr("0500 Emergency stop"));
}

TEST_F(MachineHoldWriting, AMotionWhoseStateCannotBeWrittenIsNotSent) {
  ASSERT_NO_FATAL_FAILURE(start(false));
  fs::create_directories(config_.daemon.data_dir);
  const auto in_the_way = file().string() + "." + std::to_string(::getpid()) + ".new";
  fs::create_directories(in_the_way + "/full");
  go();
  ASSERT_TRUE(machine_.serve_until([&] { return health().faults > 0; }));
  EXPECT_THAT(health().last_fault,
              testing::AllOf(HasSubstr("GoTo was not sent"), HasSubstr("machine-hold")));
  EXPECT_TRUE(machine_.serve_until([&] { return devices_->points_left() == 0; }));
  EXPECT_FALSE(machine_.heard("GoTo"));
}

}  // namespace
}  // namespace abbe::daemon
