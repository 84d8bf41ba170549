// Recorded lines of axes, sent again by the simulator over a socket to an unmodified device.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "abbe/sim/replay.hpp"
#include "printed_axes.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using printed_axes::PrintedAxesOverTcp;
using protocol::AxisSample;

sim::RecordedDevice recorded(const std::vector<protocol::RawBlock>& blocks) {
  sim::RecordedDevice device{"axis_lines", sim::RecordedKind::Lines, {}};
  for (const protocol::RawBlock& block : blocks) {
    sim::RecordedBlock& out = device.blocks.emplace_back();
    out.time = block.time;
    out.to_device = block.direction == protocol::RawBlock::Direction::ToDevice;
    out.bytes.assign(block.bytes.begin(), block.bytes.begin() + block.length);
  }
  return device;
}

std::vector<AxisSample> received_from(const sim::RecordedDevice& recording, std::size_t count) {
  SteppedTime time;
  sim::ReplaySetup setup;
  setup.axes = recording.name;
  auto replay = sim::Replay::open({recording}, setup, time.now()).value();
  drivers::LineAxesOptions options;
  options.address = drivers::LineTcp{"127.0.0.1", replay->places().at(0).port};
  options.receiver.format = line_sender::time_axes_status();
  options.receiver.time_separation = 2ms;
  const auto device = drivers::LineAxesDevice::create(options, time).value();

  std::vector<AxisSample> samples;
  std::vector<AxisSample> some(256);
  for (const auto end = time.now() + 20s; time.now() < end && samples.size() < count;
       time.advance(1ms)) {
    replay->poll(time.now());
    device->wait(1ms);
    device->receive();
    const std::size_t n = device->samples().pop(some);
    samples.insert(samples.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(n));
  }
  EXPECT_EQ(device->status().faults, 0u) << device->status().last_fault;
  return samples;
}

TEST(LineReplay, GivesThePositionsThatWereRecorded) {
  PrintedAxesOverTcp axes{printed_axes::printing(line_sender::time_axes_status()), {}};
  axes.machine.start(axes.time.now());
  axes.run_for(3s);
  ASSERT_GT(axes.samples.size(), 1400u);

  const auto again = received_from(recorded(axes.blocks), axes.samples.size());
  ASSERT_EQ(again.size(), axes.samples.size());
  constexpr double kCycles_ns = 2e6;  // one of each simulation
  for (std::size_t i = 0; i < again.size(); ++i) {
    EXPECT_EQ(again[i].position, axes.samples[i].position);
    EXPECT_EQ(again[i].missing_mask, axes.samples[i].missing_mask);
    EXPECT_EQ(again[i].head.flags, axes.samples[i].head.flags);
    EXPECT_NEAR(
        static_cast<double>((again[i].head.time - again[0].head.time).count()),
        static_cast<double>((axes.samples[i].head.time - axes.samples[0].head.time).count()),
        kCycles_ns);
  }
}

}  // namespace
}  // namespace abbe::tests
