// A tracker that sends lines and one that speaks emScon, with the same seed: the samples that the
// identification gets have the same errors of time and position, and the same uncertainty.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <iostream>
#include <memory>
#include <vector>

#include "abbe/drivers/lines/device.hpp"
#include "abbe/drivers/tracker/device.hpp"
#include "abbe/sim/line_tracker_server.hpp"
#include "line_peer.hpp"
#include "stepped_time.hpp"
#include "tracker_peer.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using protocol::TrackerPoint;

constexpr std::chrono::nanoseconds kSettling = 60s;  // the time of the clock model
constexpr std::chrono::nanoseconds kDuration = 120s;
/// Arrivals are seen at most this much late: little against the delay of the points, 1 ms.
constexpr std::chrono::nanoseconds kCycle = 1ms;

double seconds_of(std::chrono::nanoseconds d) {
  return std::chrono::duration<double>(d).count();
}

struct SampleErrors {
  std::size_t count = 0;
  double rms_time_s = 0.0;  ///< against the instant at which the simulator measured
  double mean_u_time_s = 0.0;
  double rms_position_m = 0.0;  ///< about the mean: the machine stands
};

SampleErrors errors_of(const std::vector<TrackerPoint>& points, HostTime power_on) {
  SampleErrors out;
  std::array<double, 3> sum{}, squares{};
  for (const TrackerPoint& point : points) {
    if (point.head.time < power_on + kSettling) continue;
    const auto measured = sim::host_time(sim::TrackerModel{}, power_on, point.device_time);
    ++out.count;
    out.rms_time_s += std::pow(seconds_of(point.head.time - measured), 2);
    out.mean_u_time_s += seconds_of(point.head.u_time);
    for (std::size_t i = 0; i < 3; ++i) {
      // about the first point, so that squares lose no digits
      const double d = point.p_tracker_m[i] - points.front().p_tracker_m[i];
      sum[i] += d;
      squares[i] += d * d;
    }
  }
  const auto n = static_cast<double>(out.count);
  out.rms_time_s = std::sqrt(out.rms_time_s / n);
  out.mean_u_time_s /= n;
  for (std::size_t i = 0; i < 3; ++i)
    out.rms_position_m += squares[i] / n - std::pow(sum[i] / n, 2);
  out.rms_position_m = std::sqrt(out.rms_position_m);
  return out;
}

template <class Device, class Ring, class Serve>
SampleErrors errors_through(Device& device, Ring& points, SteppedTime& time, HostTime power_on,
                            Serve serve) {
  std::vector<TrackerPoint> all, taken(1024);
  for (const auto end = time.now() + kDuration; time.now() < end; time.advance(kCycle)) {
    serve();
    device.wait(kCycle);
    device.receive();
    const std::size_t n = points.pop(taken);
    all.insert(all.end(), taken.begin(), taken.begin() + static_cast<std::ptrdiff_t>(n));
  }
  return errors_of(all, power_on);
}

SampleErrors errors_through_emscon() {
  SteppedTime time;
  const auto power_on = time.now();
  tracker::TrackerPeer peer{time.now()};
  drivers::TrackerDeviceOptions options;
  options.host = "127.0.0.1";
  options.port = peer.port();
  const auto device = drivers::TrackerDevice::create(options, time).value();
  return errors_through(*device, device->points(), time, power_on, [&] {
    peer.serve(time.now());
    peer.send_points();
  });
}

SampleErrors errors_through_lines() {
  SteppedTime time;
  const auto power_on = time.now();
  const auto machine = tracker::standing_machine();
  const auto format = line_sender::time_x_y_z_status();
  auto server = sim::LineTrackerServer::open(
                    {},
                    std::make_unique<sim::LineTracker>(sim::LineTrackerOptions{.format = format},
                                                       machine, time.now()),
                    time.now())
                    .value();
  drivers::LineTrackerOptions options;
  options.address = drivers::LineTcp{"127.0.0.1", server.port()};
  options.receiver.format = format;
  options.receiver.time_separation = 2ms;
  const auto device = drivers::LineTrackerDevice::create(options, time).value();
  return errors_through(*device, device->samples(), time, power_on,
                        [&] { server.poll(time.now()); });
}

TEST(LineTrackerPair, GivesSamplesWithTheErrorsOfEmScon) {
  constexpr double kSame = 0.05;  // required of a run through lines
  const auto emscon = errors_through_emscon();
  const auto lines = errors_through_lines();
  ASSERT_GT(emscon.count, 25'000u);
  ASSERT_GT(lines.count, 25'000u);
  EXPECT_NEAR(lines.rms_position_m / emscon.rms_position_m, 1.0, kSame);
  EXPECT_NEAR(lines.mean_u_time_s / emscon.mean_u_time_s, 1.0, kSame);
  EXPECT_NEAR(lines.rms_time_s / emscon.rms_time_s, 1.0, kSame);
  std::cout << "emScon: position " << 1e6 * emscon.rms_position_m << " um, time "
            << 1e6 * emscon.rms_time_s << " us, u " << 1e6 * emscon.mean_u_time_s
            << " us; lines: position " << 1e6 * lines.rms_position_m << " um, time "
            << 1e6 * lines.rms_time_s << " us, u " << 1e6 * lines.mean_u_time_s << " us\n";
}

}  // namespace
}  // namespace abbe::tests
