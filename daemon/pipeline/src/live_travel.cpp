#include "abbe/pipeline/live_travel.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::daemon {

using calib::estimation::Travel;

void LiveTravel::take(std::span<const double> position_m, protocol::HostTime at) {
  if (last_at_ && at - *last_at_ > patience_) *this = LiveTravel{patience_};
  const double since_last_s =
      last_at_ ? std::max(0.0, std::chrono::duration<double>(at - *last_at_).count()) : 0.0;
  for (std::size_t axis = 0; axis < axes_.size(); ++axis)
    take_axis(axis, position_m[axis], since_last_s);
  last_at_ = at;
}

void LiveTravel::take_axis(std::size_t axis, double position_m, double since_last_s) {
  constexpr double kHalf_m = 0.5 * kTurn_m;
  auto& known = axes_[axis];
  const bool jumps =
      known && std::abs(position_m - known->last_m) > kTurn_m + kMostSpeed_m_per_s * since_last_s;
  if (!std::isfinite(position_m) || jumps) {
    known.reset();
    travel_[axis] = Travel::Unknown;
  }
  if (!std::isfinite(position_m)) return;
  if (!known) known = Axis{position_m, position_m};

  known->last_m = position_m;
  if (position_m > known->centre_m + kHalf_m) {
    known->centre_m = position_m - kHalf_m;
    travel_[axis] = Travel::Forward;
  } else if (position_m < known->centre_m - kHalf_m) {
    known->centre_m = position_m + kHalf_m;
    travel_[axis] = Travel::Backward;
  }
}

}  // namespace abbe::daemon
