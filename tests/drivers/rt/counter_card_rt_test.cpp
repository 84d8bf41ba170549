#include <gtest/gtest.h>

#include <array>
#include <memory>

#include "abbe/drivers/counter_card/receiver.hpp"
#include "rt_guards.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;

CounterCardReceiverOptions options() {
  CounterCardReceiverOptions o;
  o.wiring.axes = {{.name = "X", .channel = 0, .scale = 1e-8},
                   {.name = "A", .channel = 1, .scale = 1e-6}};
  o.wiring.clock_hz = 1e6;
  o.wiring.scan_rate_hz = 40e3;
  o.wiring.latch_channel = 6;
  return o;
}

/// A millisecond of scans; every seventh with a probe edge, every eleventh after a loss, some torn.
class Transfers {
 public:
  std::span<const std::byte> next(std::size_t i) ABBE_RT {
    if (i % 7 == 0) latch_ = clock_ - 3;
    if (i % 11 == 0) clock_ += 250;
    std::size_t at = 0;
    for (int scan = 0; scan < 40; ++scan) {
      clock_ += 25;
      for (const std::uint32_t value : {clock_ * 3, clock_ * 5, clock_, latch_})
        for (int shift = 0; shift < 32; shift += 8)
          bytes_[at++] = static_cast<std::byte>(value >> shift);
    }
    return i % 13 == 0 ? std::span{bytes_}.first(639) : std::span{bytes_};
  }

 private:
  std::array<std::byte, 640> bytes_{};
  std::uint32_t clock_ = 0;
  std::uint32_t latch_ = 0;
};

std::size_t receive(CounterCardReceiver& receiver, Transfers& transfers, std::size_t i) ABBE_RT {
  if (receiver.out_of_step() || i == 0) {
    receiver.on_control(quad08::write(quad08::Register::DmaControl, quad08::dma::kChannel1On));
  }
  if (i % 1000 == 0) receiver.on_control(quad08::write(quad08::Register::CounterSetup, 0x0801));
  receiver.push(transfers.next(i), HostTime{1h + 1ms * static_cast<std::int64_t>(i)});
  std::size_t scans = 0;
  for (auto some = receiver.next(); !some.empty(); some = receiver.next()) scans += some.size();
  return scans;
}

TEST(CounterCardReceiverRt, TakesNoMemory) {
  const auto receiver = std::make_unique<CounterCardReceiver>(options());
  Transfers transfers;
  std::size_t scans = 0;
  tests::expect_no_allocation(10'000,
                              [&](std::size_t i) { scans += receive(*receiver, transfers, i); });
  EXPECT_GT(scans, 100'000u);
}

TEST(CounterCardReceiverRt, MakesNoSystemCall) {
  const auto receiver = std::make_unique<CounterCardReceiver>(options());
  Transfers transfers;
  tests::expect_no_system_call([&] {
    for (std::size_t i = 0; i < 100; ++i) (void)receive(*receiver, transfers, i);
  });
}

}  // namespace
}  // namespace abbe::drivers
