#pragma once
/// A control that prints the axes of a simulated machine, and the device that reads it over TCP, on
/// one stepped clock.

#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "abbe/drivers/lines/device.hpp"
#include "abbe/sim/line_tracker_server.hpp"
#include "line_peer.hpp"
#include "stepped_time.hpp"

namespace abbe::tests::printed_axes {

/// Moves along X from -0.2 m to 0.2 m with this speed once it is started.
inline constexpr double kSpeed_m_per_s = 0.04;
inline sim::VirtualMachine moving_machine() {
  sim::PathPlan plan;
  plan.vertices = {{{-0.2, 0.1, -0.3}}, {{0.2, 0.1, -0.3}}};
  plan.feed_m_per_s = kSpeed_m_per_s;
  return {sim::TruthMachine{}, sim::PathMotion::plan(plan).value()};
}

inline sim::LineAxesOptions printing(const drivers::lines::ValueFormat& format) {
  sim::LineAxesOptions options;
  options.format = format;
  options.axes = {sim::Axis::X, sim::Axis::Y, sim::Axis::Z};
  return options;
}

/// X, Y, Z in mm without time and status.
inline drivers::lines::ValueFormat axes_alone() {
  drivers::lines::ValueFormat format;
  const auto all = line_sender::time_axes_status();
  for (std::size_t i = 0; i < 3; ++i) {
    format.columns[i] = all.columns[i + 1];
    format.names[i] = all.names[i + 1];
  }
  format.column_count = format.value_count = 3;
  return format;
}

class PrintedAxesOverTcp {
 public:
  PrintedAxesOverTcp(const sim::LineAxesOptions& printed, drivers::LineAxesOptions read)
      : separation_(printed.times.separation),
        server_(sim::LineAxesServer::open(
                    {}, std::make_unique<sim::LineAxes>(printed, machine, time.now()), time.now())
                    .value()),
        options_(std::move(read)) {
    options_.address = drivers::LineTcp{"127.0.0.1", server_.port()};
    options_.receiver.format = printed.format;
    if (options_.receiver.time_separation.count() == 0)
      options_.receiver.time_separation = separation_;
    device = drivers::LineAxesDevice::create(options_, time).value();
  }

  void run_for(std::chrono::nanoseconds duration,
               std::chrono::nanoseconds cycle = std::chrono::milliseconds{1}) {
    for (const auto end = time.now() + duration; time.now() < end; time.advance(cycle)) {
      server_.poll(time.now());
      device->wait(cycle);
      device->receive();
      take();
    }
  }
  void inject(sim::FaultKind kind, double duration_s = 1.0) {
    server_.device().inject({.kind = kind, .duration_s = duration_s}, time.now());
  }
  /// As the decoder of a recording.
  [[nodiscard]] std::vector<protocol::AxisSample> decoded_again() const {
    const auto recorded = std::make_unique<drivers::LineBlocks<drivers::LineAxisReceiver>>(
        drivers::receiver_options(options_));
    std::vector<protocol::AxisSample> again;
    for (const auto& block : blocks)
      recorded->take(block,
                     [&](auto read) { again.insert(again.end(), read.begin(), read.end()); });
    return again;
  }

  SteppedTime time;
  sim::VirtualMachine machine = moving_machine();
  std::unique_ptr<drivers::LineAxesDevice> device;
  std::vector<protocol::AxisSample> samples;
  std::vector<protocol::RawBlock> blocks;

 private:
  void take() {
    std::vector<protocol::AxisSample> some(256);
    some.resize(device->samples().pop(some));
    samples.insert(samples.end(), some.begin(), some.end());
    std::vector<protocol::RawBlock> read(16);
    read.resize(device->raw().pop(read));
    blocks.insert(blocks.end(), read.begin(), read.end());
  }

  std::chrono::nanoseconds separation_;
  sim::LineAxesServer server_;
  drivers::LineAxesOptions options_;
};

}  // namespace abbe::tests::printed_axes
