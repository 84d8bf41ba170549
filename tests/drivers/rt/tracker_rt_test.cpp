#include <memory>

#include "../tracker_script.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/tracker/receiver.hpp"
#include "rt_guards.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using namespace tracker;

class TrackerRealTimePath : public testing::Test {
 protected:
  /// Ten points as they come on the wire, and everything else a controller may send.
  void cycle(std::size_t i) ABBE_RT {
    receiver_->push(bursts_[i % bursts_.size()], now_ += 20ms);
    receiver_->push(others_, now_);
    while (const auto message = receiver_->next()) {
      if (const auto* b = std::get_if<drivers::TrackerBurst>(&*message)) ring_.push(b->points);
    }
  }

  static std::vector<Bytes> make_bursts() {
    std::vector<Bytes> bursts;
    protocol::DeviceTime t{100s};
    for (int i = 0; i < 1100; ++i) {
      emscon::MultiHead head;
      head.environment.temperature = 20.0 + i % 2;
      bursts.push_back(burst(points_until(t += 20ms, 10, 2ms), head));
    }
    return bursts;
  }
  static Bytes make_others() {
    Bytes bytes = ok(emscon::Command::SetUnits);
    for (const Bytes& more :
         {packet(emscon::StatusChange{emscon::Event::MeasurementNotReady}),
          packet(emscon::ErrorResponse{}), packet(emscon::ReflectorPosition{})}) {
      bytes.insert(bytes.end(), more.begin(), more.end());
    }
    return bytes;
  }

  std::vector<Bytes> bursts_ = make_bursts();
  Bytes others_ = make_others();
  protocol::HostTime now_{1h};
  drivers::SampleRing<protocol::TrackerPoint> ring_{16384};
  std::unique_ptr<drivers::TrackerReceiver> receiver_ =
      std::make_unique<drivers::TrackerReceiver>();
};

TEST_F(TrackerRealTimePath, AllocatesNothingOverTenThousandPoints) {
  expect_no_allocation(1000, [this](std::size_t i) { cycle(i); });
  std::vector<protocol::TrackerPoint> out(ring_.capacity());
  EXPECT_EQ(ring_.pop(out), 10'000u);
}

TEST_F(TrackerRealTimePath, MakesNoSystemCall) {
  cycle(0);
  expect_no_system_call([this] {
    for (std::size_t i = 1; i < 100; ++i) cycle(i);
  });
}

TEST_F(TrackerRealTimePath, HandlesMalformedBytesAndNewConnections) {
  expect_no_allocation(100, [this](std::size_t i) {
    static constexpr std::array<std::byte, 12> kMalformed{std::byte{'G'}, std::byte{'E'},
                                                          std::byte{'T'}, std::byte{' '}};
    receiver_->push({}, now_);
    receiver_->push(kMalformed, now_);
    while (const auto message = receiver_->next()) {
    }
    cycle(i);
  });
  EXPECT_EQ(receiver_->counters().protocol_errors, 100u);
}

}  // namespace
}  // namespace abbe::tests
