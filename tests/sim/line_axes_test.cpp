#include "abbe/sim/line_axes.hpp"

#include <gmock/gmock.h>

#include <sstream>
#include <string>
#include <vector>

#include "tracker_script.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;
using lines::ColumnUse;

/// time X status.
LineAxesOptions one_axis() {
  LineAxesOptions options;
  lines::ValueFormat& format = options.format;
  format.column_count = 3;
  format.columns[0].use = ColumnUse::Time;
  format.columns[1] = {
      .use = ColumnUse::Value, .value = 0, .scale = 1e-3, .offset = 0.0, .limit = 1e6};
  format.columns[2].use = ColumnUse::Status;
  format.value_count = 1;
  format.valid_status[0] = lines::StatusWord::from("OK").value();
  format.valid_status_count = 1;
  options.axes = {Axis::X};
  options.noise = 0.0;
  return options;
}

std::vector<std::string> lines_in(const std::string& text) {
  std::vector<std::string> all;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) all.push_back(line);
  return all;
}

class PrintedAxisLines : public testing::Test {
 protected:
  /// What is printed in each millisecond of `duration`.
  std::vector<std::string> texts_of(LineAxes& axes, std::chrono::nanoseconds duration) {
    std::vector<std::string> texts;
    for (const HostTime end = now_ + duration; now_ < end; now_ += 1ms) {
      axes.advance(now_);
      if (auto text = axes.take_output(); !text.empty()) texts.push_back(std::move(text));
    }
    return texts;
  }

  const VirtualMachine machine_ = test::standing_machine();
  HostTime now_{100s};
};

TEST_F(PrintedAxisLines, HaveTheReadingOfTheMachine) {
  LineAxes axes{one_axis(), machine_, now_};
  axes.connected(now_);
  const auto texts = texts_of(axes, 1s);
  ASSERT_FALSE(texts.empty());
  auto first = texts.front();
  first.pop_back();
  const auto line = lines::decode(first, one_axis().format);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->value[0], machine_.motion(now_).q_m[0], 1e-14);
  EXPECT_TRUE(line->valid);
}

TEST_F(PrintedAxisLines, ComeOneByOneUnlessTheyComeInBursts) {
  LineAxes at_once{one_axis(), machine_, now_};
  at_once.connected(now_);
  const auto texts = texts_of(at_once, 2s);
  EXPECT_NEAR(static_cast<double>(texts.size()), 1000.0, 2.0);
  for (const auto& text : texts) EXPECT_LE(lines_in(text).size(), 2u);

  auto options = one_axis();
  options.times.bursts = true;
  LineAxes in_bursts{options, machine_, now_};
  in_bursts.connected(now_);
  EXPECT_NEAR(static_cast<double>(lines_in(texts_of(in_bursts, 1s).front()).size()), 166.0, 8.0);
}

TEST_F(PrintedAxisLines, AreInvalidStalledOrGoneByFaults) {
  LineAxes axes{one_axis(), machine_, now_};
  axes.connected(now_);
  texts_of(axes, 100ms);
  axes.inject({.kind = FaultKind::PrismError, .duration_s = 0.1}, now_);
  EXPECT_THAT(texts_of(axes, 50ms), testing::Contains(testing::HasSubstr(" bad\n")));
  axes.inject({.kind = FaultKind::Mute, .duration_s = 0.2}, now_);
  EXPECT_THAT(texts_of(axes, 200ms), testing::IsEmpty());
  EXPECT_THAT(texts_of(axes, 100ms), testing::Not(testing::IsEmpty()));
  axes.inject({.kind = FaultKind::Disconnect}, now_);
  EXPECT_TRUE(axes.take_hang_up());
}

}  // namespace
}  // namespace abbe::sim
