// Axis positions as lines and as encoders on CANopen, of one simulated machine with one seed: the
// readings differ by no more than the uncertainty of their times explains.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <memory>
#include <vector>

#include "abbe/drivers/can/encoder_device.hpp"
#include "abbe/drivers/can/udp_can_bus.hpp"
#include "abbe/sim/encoder_bus.hpp"
#include "printed_axes.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using printed_axes::kSpeed_m_per_s;
using printed_axes::PrintedAxesOverTcp;
using protocol::AxisSample;
using protocol::HostTime;

constexpr std::chrono::nanoseconds kBeforeMotion = 20s;
constexpr std::chrono::nanoseconds kMotion = 9s;  // of 10 s
/// Noise of a reading and the rounding to counts of 10 nm.
constexpr double kReading_m = 6e-9;

struct PositionErrors {
  std::size_t count = 0;
  double mean_m = 0.0;  ///< against the reading of the machine at the time of the sample
  double largest_m = 0.0;
  double mean_u_time_s = 0.0;
};

/// During the motion at constant speed.
PositionErrors errors_of(const std::vector<AxisSample>& samples, const sim::VirtualMachine& machine,
                         HostTime start) {
  PositionErrors out;
  for (const AxisSample& sample : samples) {
    if (sample.head.time < start + 1s || sample.head.time > start + kMotion) continue;
    if (sample.missing_mask != 0) continue;
    const double error = sample.position[0] - machine.motion(sample.head.time).q_m[0];
    ++out.count;
    out.mean_m += error;
    out.largest_m = std::max(out.largest_m, std::abs(error));
    out.mean_u_time_s += std::chrono::duration<double>(sample.head.u_time).count();
  }
  out.mean_m /= static_cast<double>(out.count);
  out.mean_u_time_s /= static_cast<double>(out.count);
  return out;
}

PositionErrors through_encoders() {
  SteppedTime time;
  sim::VirtualMachine machine = printed_axes::moving_machine();
  std::vector<sim::EncoderNodeOptions> nodes(3);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i].node = static_cast<sim::can::NodeId>(i + 1);
    nodes[i].axis = sim::kAxes[i];
  }
  auto bus = sim::EncoderBus::open({}, nodes, machine, time.now()).value();
  drivers::EncoderDeviceOptions options;
  options.receiver.axes = {
      {.name = "X", .node = 1}, {.name = "Y", .node = 2}, {.name = "Z", .node = 3}};
  options.receiver.sync_period = 2ms;
  const auto device = drivers::EncoderDevice::create(
                          options,
                          std::make_unique<drivers::UdpCanBus>(
                              drivers::UdpCanOptions{.peer_port = bus.port(), .speed = 0.0}, time),
                          time)
                          .value();

  const HostTime start = time.now() + 3s;
  machine.start(start);
  std::vector<AxisSample> samples;
  std::array<AxisSample, 64> some{};
  for (; time.now() < start + kMotion; time.advance(1ms)) {
    device->wait(1ms);
    device->receive();
    bus.poll(time.now());  // a SYNC is answered at the instant at which it was sent
    const std::size_t n = device->samples().pop(some);
    samples.insert(samples.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(n));
  }
  return errors_of(samples, machine, start);
}

PositionErrors through_lines(const drivers::lines::ValueFormat& format,
                             const drivers::LineAxesOptions& options) {
  PrintedAxesOverTcp axes{printed_axes::printing(format), options};
  const HostTime start = axes.time.now() + kBeforeMotion;
  axes.machine.start(start);
  axes.run_for(kBeforeMotion + kMotion);
  return errors_of(axes.samples, axes.machine, start);
}

/// Largest error of a time with a rectangular distribution, as a distance.
double explained_m(const PositionErrors& errors) {
  return kSpeed_m_per_s * std::sqrt(3.0) * errors.mean_u_time_s + 6.0 * kReading_m;
}

void print(const char* name, const PositionErrors& errors) {
  std::cout << name << ": " << errors.count << " positions, mean error " << 1e6 * errors.mean_m
            << " um, largest " << 1e6 * errors.largest_m << " um, u of the time "
            << 1e6 * errors.mean_u_time_s << " us\n";
}

TEST(LineAxesPair, HavePositionsOfEncodersWithinTheUncertaintyOfTheTime) {
  const auto encoders = through_encoders();
  const auto lines = through_lines(line_sender::time_axes_status(), {});
  print("encoders", encoders);
  print("lines", lines);
  ASSERT_GT(encoders.count, 3900u);
  ASSERT_GT(lines.count, 3900u);
  EXPECT_LE(lines.largest_m, explained_m(lines));
  EXPECT_LE(std::abs(lines.mean_m - encoders.mean_m), explained_m(lines) + explained_m(encoders));
}

TEST(LineAxesPair, AreAsUncertainByArrivalAsTheirLatencyStates) {
  drivers::LineAxesOptions options;
  options.receiver.clock.max_constant_delay = 5ms;
  const auto lines = through_lines(printed_axes::axes_alone(), options);
  print("lines by arrival", lines);
  ASSERT_GT(lines.count, 3900u);
  EXPECT_LE(lines.largest_m, explained_m(lines));
  EXPECT_GT(lines.largest_m, 1e-6);  // the delay of 1 to 2 ms is not half of 5 ms
}

}  // namespace
}  // namespace abbe::tests
