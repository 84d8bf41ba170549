#pragma once
/// A controller's side of a tracker test: packets as bytes, and a stream of points with a clock of
/// its own.

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "abbe/protocol/emscon/results.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::tests::tracker {

namespace emscon = protocol::emscon;
using Bytes = std::vector<std::byte>;

template <class... Arguments>
Bytes packet(const Arguments&... arguments) {
  Bytes bytes(emscon::kMaxPacketSize);
  bytes.resize(emscon::encode(arguments..., std::span<std::byte>{bytes}));
  return bytes;
}

inline emscon::MultiPoint point(protocol::DeviceTime t,
                                std::array<double, 3> p_mm = {1000, 2000, -300},
                                emscon::PointStatus status = emscon::PointStatus::Ok) {
  return {status, emscon::TrackerClockReading::from(t), p_mm};
}

/// `count` points that end at `last`.
inline std::vector<emscon::MultiPoint> points_until(protocol::DeviceTime last, int count,
                                                    std::chrono::nanoseconds separation) {
  std::vector<emscon::MultiPoint> points;
  for (int k = count - 1; k >= 0; --k) points.push_back(point(last - k * separation));
  return points;
}

inline Bytes burst(std::span<const emscon::MultiPoint> points, const emscon::MultiHead& head = {}) {
  return packet(head, points);
}

inline Bytes ok(emscon::Command command) {
  return packet(emscon::Answer{emscon::Acknowledge{command, {}}});
}

}  // namespace abbe::tests::tracker
