// The hub runs at FIFO priority 30 and abbe-dds at 20: a mutex that an ordinary thread holds would
// let abbe-dds hold up the hub for as long as it likes. So the hub takes none.
#include <gmock/gmock.h>

#include <algorithm>
#include <mutex>
#include <thread>

#include "abbe/calib/otf/plan/plan.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/service/background_tasks.hpp"
#include "allocation_count.hpp"
#include "config_tables.hpp"
#include "hub_bench.hpp"
#include "lock_count.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using protocol::HostTime;
using tests::LockCount;

/// Samples and bytes of every device, in every cycle.
struct BusyDevices final : SampleSource {
  void drain(Batch& batch) override {
    ++turn;
    for (std::uint32_t i = 0; i < 4; ++i) {
      protocol::AxisSample axes;
      axes.head.time = clock->now() + std::chrono::microseconds{i};
      axes.axis_count = 3;
      batch.axes.push_back(axes);
      batch.raw.push_back({1, example_block(turn)});
    }
    auto& point = batch.points.emplace_back();
    point.head.time = clock->now();
    point.device_time = protocol::DeviceTime{clock->now().time_since_epoch()};
    batch.raw.push_back({0, example_block(turn)});
  }
  [[nodiscard]] std::vector<StreamHealth> health(HostTime) override {
    StreamHealth h;
    h.status = board.read("encoder", 0, 0);
    return {h};
  }
  const drivers::TimeSource* clock = nullptr;
  drivers::StatusBoard board;
  std::uint32_t turn = 0;
};

class HubLocks : public test::HubBench<BusyDevices> {
 protected:
  HubLocks() {
    prepare_background_tasks();
    devices_.clock = &time_;
    config_.of<TrackerConfig>().emplace().host = "127.0.0.1";
    RecorderThreadOptions options;
    options.recorder = example_options(folder_.path());
    options.devices.all = {"tracker", "encoder"};
    recorder_ = RecorderThread::start(std::move(options), example_info()).value();
    verification_.emplace(config_);
    make_hub();
  }

  void cycle(std::chrono::nanoseconds = {}) override {
    time_.passed += 1ms;
    const LockCount locks;
    const tests::AllocationCount allocations;
    hub_->cycle(time_.wall_now());
    most_allocations_ = std::max(most_allocations_, allocations.value());
    locks_ += locks.value();
    (void)far_->take();
  }

  std::uint64_t locks_ = 0;
  std::uint64_t most_allocations_ = 0;  // in one cycle
};

TEST_F(HubLocks, NoneIsTakenInACycle) {
  if (!tests::kLocksAreCounted) GTEST_SKIP() << "the sanitizer has mutexes of its own";
  for (int i = 0; i < 3000; ++i) cycle();  // three seconds: health, recorder, store
  EXPECT_EQ(locks_, 0u);
}

TEST_F(HubLocks, NoneIsTakenForARequest) {
  if (!tests::kLocksAreCounted) GTEST_SKIP() << "the sanitizer has mutexes of its own";
  for (int i = 0; i < 20; ++i) ask({{"do", "status"}});
  ask({{"do", "calibrate"}, {"method", "otf"}, {"path_m", {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}}});
  ask({{"do", "cancel"}});
  ask({{"do", "verification"}, {"step", "begin"}});
  ask({{"do", "verification"}, {"step", "look"}, {"number", 1}});
  EXPECT_EQ(locks_, 0u);
}

/// A request that is parsed or written into the recording by the hub takes memory for each of its
/// parts.
TEST_F(HubLocks, WorkForARequestDoesNotDependOnItsSize) {
  const auto machine = parse_config(to_toml(config_tables::mill()), "machine.toml");
  ASSERT_TRUE(machine) << machine.error().text;
  config_.machine = machine->machine;

  const auto most_for = [this](std::size_t vertices) {
    json path = json::array();
    for (const auto& q : calib::otf::base_path(otf_machine(config_.machine)->nodes).vertices_m)
      path.push_back({q.x(), q.y(), q.z()});
    while (path.size() < vertices)
      path.push_back({0.0, 1e-6 * static_cast<double>(path.size()), -0.25});
    most_allocations_ = 0;
    const json begun = ask({{"do", "calibrate"}, {"method", "otf"}, {"path_m", path}});
    EXPECT_EQ(begun["ok"], true) << begun.dump();
    EXPECT_EQ(ask({{"do", "cancel"}})["ok"], true);
    return most_allocations_;
  };

  (void)most_for(0);  // buffers grow
  const auto for_few = most_for(0);
  EXPECT_LT(most_for(20'000), 2 * for_few + 100);
}

TEST_F(HubLocks, NoneIsTakenForAModelActivatedByAnotherProcess) {
  if (!tests::kLocksAreCounted) GTEST_SKIP() << "the sanitizer has mutexes of its own";
  const auto kept = keep_a_model();
  ASSERT_TRUE(kept) << kept.error().text;
  while (hub_->model_state().model == nullptr) cycle();
  cycle();
  EXPECT_EQ(locks_, 0u);
}

TEST_F(HubLocks, AreDetectedByTheGuard) {
  if (!tests::kLocksAreCounted) GTEST_SKIP() << "the sanitizer has mutexes of its own";
  const LockCount locks;
  std::mutex mutex;
  { const std::lock_guard held{mutex}; }
  std::thread{[] {}}.join();
  EXPECT_EQ(locks.value(), 2u);
}

}  // namespace
}  // namespace abbe::daemon
