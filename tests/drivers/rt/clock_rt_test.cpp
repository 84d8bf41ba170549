#include "../burst_profile.hpp"
#include "abbe/drivers/clock_model.hpp"
#include "abbe/drivers/kernel_stamp.hpp"
#include "abbe/drivers/status_board.hpp"
#include "rt_guards.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::ClockModel;
using drivers::KernelStampMap;
using drivers::StatusBoard;
using protocol::DeviceTime;
using protocol::HostTime;

TEST(ClockModelRt, TakesNoMemoryIn10000Samples) {
  ClockModel model;
  BurstProfile profile(1, {});
  expect_no_allocation(10'000, [&](std::size_t i) {
    if (i % 166 == 0) {
      const Packet p = profile.next();
      model.observe(p.last_point, p.arrival);
    }
    (void)model.to_host(profile.device_at(profile.last_point_s()));
  });
  EXPECT_TRUE(model.status().settled);
}

TEST(ClockModelRt, MakesNoSystemCall) {
  ClockModel model;
  expect_no_system_call([&] {
    for (int i = 0; i < 500; ++i)
      model.observe(DeviceTime{i * 332ms}, HostTime{100s + i * 332ms + i % 7 * 1ms});
    model.observe(DeviceTime{1s}, HostTime{300s});  // and a restart
    (void)model.status();
  });
}

TEST(KernelStampMapRt, TakesNoMemoryAndMakesNoSystemCall) {
  KernelStampMap map;
  const auto read = [&](std::size_t i) {
    const auto now = std::chrono::milliseconds(i);
    map.arrival(1000s + now - 5us, {now, 1000s + now}, HostTime{now});
    map.nothing_older_than({now, 1000s + now});
  };
  expect_no_allocation(10'000, read);
  expect_no_system_call([&] { read(10'001); });
}

TEST(StatusBoardRt, TakesNoMemoryAndMakesNoSystemCall) {
  StatusBoard board;
  const auto write = [&](std::size_t i) {
    board.samples.add();
    board.set_state("streaming");
    board.set_last_sample(HostTime{std::chrono::nanoseconds(i)});
    board.fault(HostTime{}, "peer: said nonsense");
  };
  expect_no_allocation(10'000, write);
  expect_no_system_call([&] { write(1); });
  EXPECT_EQ(board.samples.value(), 10'000u);
}

}  // namespace
}  // namespace abbe::tests
