#pragma once
/// A receiver of three encoders with a script of events; all samples are kept.

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/drivers/can/encoder_receiver.hpp"

namespace abbe::drivers::encoder_line {

using namespace std::chrono_literals;
using protocol::AxisSample;
using protocol::HostTime;

inline constexpr HostTime kStart{1h};
inline constexpr std::array<can::NodeId, 3> kNodes{1, 2, 3};

inline EncoderReceiverOptions three_axes(std::optional<double> scale = 1e-8) {
  EncoderReceiverOptions options;
  for (const can::NodeId node : kNodes) {
    options.axes.push_back({.name = "XYZ" + std::to_string(node), .node = node, .scale = scale});
  }
  return options;
}
inline can::CanFrame position(can::NodeId node, std::int64_t count) {
  return can::encode_position(can::cob::tpdo(1, node), can::PositionType::Signed32, count);
}

struct Line {
  explicit Line(const EncoderReceiverOptions& options = three_axes()) : receiver(options) {}

  void keep(std::span<const AxisSample> s) { samples.insert(samples.end(), s.begin(), s.end()); }
  void sync(HostTime t) { keep(receiver.on_sent(can::encode_sync(), t)); }
  void frame(const can::CanFrame& f, HostTime t) { keep(receiver.on_frame(f, t)); }
  void time(HostTime t) { keep(receiver.on_time(t)); }
  /// Time passes until no cycle is open and no sample is held.
  void finish() {
    while (receiver.deadline() != HostTime::max()) time(receiver.deadline());
  }
  /// A whole cycle in which the axes answer `count`, + 1, + 2.
  void cycle(HostTime t, std::int64_t count) {
    sync(t);
    for (const can::NodeId node : kNodes) frame(position(node, count + node - 1), t + 100us * node);
  }

  EncoderReceiver receiver;
  std::vector<AxisSample> samples;
};

}  // namespace abbe::drivers::encoder_line
