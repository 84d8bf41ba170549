#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "abbe/drivers/lines/receiver.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "rt_guards.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::lines::Column;

drivers::LineReceiverOptions line_options() {
  drivers::LineReceiverOptions options;
  options.format.columns = {Column::Time, Column::Range, Column::Azimuth, Column::Elevation,
                            Column::Status};
  options.format.column_count = 5;
  options.format.valid_status[0] = drivers::lines::StatusWord::from("0").value();
  options.format.valid_status_count = 1;
  options.time_separation = 2ms;
  return options;
}

class LineRealTimePath : public testing::Test {
 protected:
  void cycle(std::size_t i) ABBE_RT {
    receiver_->push(std::as_bytes(std::span{reads_[i % reads_.size()]}), now_ += 20ms);
    for (auto points = receiver_->next(); !points.empty(); points = receiver_->next())
      ring_.push(points);
  }

  /// Ten points each, and a line that is none.
  static std::vector<std::string> make_reads() {
    std::vector<std::string> reads;
    for (int i = 0; i < 1100; ++i) {
      std::string read = "no line 1 of any tracker\n";
      for (int k = 0; k < 10; ++k)
        read += fmt::format("{:.3f} 1523.5 0.25 -0.125 0\n", 100.0 + 0.02 * i + 0.002 * k);
      reads.push_back(read);
    }
    return reads;
  }

  std::vector<std::string> reads_ = make_reads();
  protocol::HostTime now_{1h};
  drivers::SampleRing<protocol::TrackerPoint> ring_{16384};
  std::unique_ptr<drivers::LineReceiver> receiver_ =
      std::make_unique<drivers::LineReceiver>(line_options());
};

TEST_F(LineRealTimePath, AllocatesNothingOverTenThousandPoints) {
  receiver_->push({}, now_);
  expect_no_allocation(1000, [this](std::size_t i) { cycle(i); });
  std::vector<protocol::TrackerPoint> out(ring_.capacity());
  EXPECT_EQ(ring_.pop(out), 10'000u);
  EXPECT_EQ(receiver_->counters().unreadable, 1000u);
}

TEST_F(LineRealTimePath, MakesNoSystemCall) {
  cycle(0);
  expect_no_system_call([this] {
    for (std::size_t i = 1; i < 100; ++i) cycle(i);
  });
}

}  // namespace
}  // namespace abbe::tests
