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
using drivers::lines::ColumnUse;

void set_columns(drivers::lines::LineFormat& format) {
  format.columns = {Column::Time, Column::Range, Column::Azimuth, Column::Elevation,
                    Column::Status};
}
void set_columns(drivers::lines::ValueFormat& format) {
  format.columns[0].use = ColumnUse::Time;
  for (std::uint8_t i = 0; i < 3; ++i)
    format.columns[1u + i] = {
        .use = ColumnUse::Value, .value = i, .scale = 1e-3, .offset = 0.0, .limit = 100.0};
  format.columns[4].use = ColumnUse::Status;
  format.value_count = 3;
}

template <class Content>
drivers::LineReceiverOptionsOf<Content> line_options() {
  drivers::LineReceiverOptionsOf<Content> options;
  set_columns(options.format);
  options.format.column_count = 5;
  options.format.valid_status[0] = drivers::lines::StatusWord::from("0").value();
  options.format.valid_status_count = 1;
  options.time_separation = 2ms;
  return options;
}

template <class Content>
class LineRealTimePath : public testing::Test {
 protected:
  using Sample = typename Content::Sample;
  using Receiver = drivers::LineReceiverOf<Content>;

  void cycle(std::size_t i) ABBE_RT {
    receiver_->push(std::as_bytes(std::span{reads_[i % reads_.size()]}), now_ += 20ms);
    for (auto samples = receiver_->next(); !samples.empty(); samples = receiver_->next())
      ring_.push(samples);
  }

  /// Ten samples each, and a line that is none.
  static std::vector<std::string> make_reads() {
    std::vector<std::string> reads;
    for (int i = 0; i < 1100; ++i) {
      std::string read = "no line 1 of any device\n";
      for (int k = 0; k < 10; ++k)
        read += fmt::format("{:.3f} 1523.5 0.25 -0.125 0\n", 100.0 + 0.02 * i + 0.002 * k);
      reads.push_back(read);
    }
    return reads;
  }

  std::vector<std::string> reads_ = make_reads();
  protocol::HostTime now_{1h};
  drivers::SampleRing<Sample> ring_{16384};
  std::unique_ptr<Receiver> receiver_ = std::make_unique<Receiver>(line_options<Content>());
};

using Contents = testing::Types<drivers::LinePoints, drivers::LineAxes>;
TYPED_TEST_SUITE(LineRealTimePath, Contents);

TYPED_TEST(LineRealTimePath, AllocatesNothingOverTenThousandSamples) {
  this->receiver_->push({}, this->now_);
  expect_no_allocation(1000, [this](std::size_t i) { this->cycle(i); });
  std::vector<typename TypeParam::Sample> out(this->ring_.capacity());
  EXPECT_EQ(this->ring_.pop(out), 10'000u);
  EXPECT_EQ(this->receiver_->counters().unreadable, 1000u);
}

TYPED_TEST(LineRealTimePath, MakesNoSystemCall) {
  this->cycle(0);
  expect_no_system_call([this] {
    for (std::size_t i = 1; i < 100; ++i) this->cycle(i);
  });
}

}  // namespace
}  // namespace abbe::tests
