#pragma once
/// What the hub took out of the rings in one turn, or a replay out of a recording: every stream in its own
/// order. Reused from turn to turn, so that it stops allocating once it has grown. Pure data.

#include <vector>

#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct Batch {
  std::vector<protocol::TrackerPoint> points;
  std::vector<protocol::AxisSample> axes;
  std::vector<protocol::EnvironmentSample> environment;
  std::vector<protocol::RawBlock> tracker_raw;
  std::vector<protocol::RawBlock> encoder_raw;

  void clear() noexcept {
    points.clear();
    axes.clear();
    environment.clear();
    tracker_raw.clear();
    encoder_raw.clear();
  }
  [[nodiscard]] bool empty() const noexcept {
    return points.empty() && axes.empty() && environment.empty() && tracker_raw.empty() &&
           encoder_raw.empty();
  }
};

}  // namespace abbe::daemon
