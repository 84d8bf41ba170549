#pragma once
/// The direction in which X, Y and Z last moved, from the readings of their scales, for models with
/// backlash. A resting axis keeps its direction. Not thread-safe; not for the RT path.
///
/// The readings pass through a play (hysteresis) operator of width kTurn_m: a reversal counts once
/// the axis has moved back by kTurn_m. This is more than the noise of a scale, and more than the
/// backlash of a machine tool (1 to 20 um): a control that applies V moves the axis by the backlash
/// when the direction changes, which must not count as a reversal.

#include <array>
#include <chrono>
#include <optional>
#include <span>

#include "abbe/calib/estimation/machine_state.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

class LiveTravel {
 public:
  static constexpr double kTurn_m = 50e-6;
  /// A step that is faster is not a motion, but a new datum of the scale.
  static constexpr double kMostSpeed_m_per_s = 5.0;

  /// After a gap in the readings that is longer than `patience` all directions are unknown: the
  /// axes may have moved meanwhile.
  explicit LiveTravel(std::chrono::nanoseconds patience) : patience_(patience) {}

  /// Readings of X, Y and Z in m, without a correction for temperature; the direction of an axis
  /// with a reading that is not finite becomes unknown.
  void take(std::span<const double> position_m, protocol::HostTime at);
  /// Unknown before the first motion.
  [[nodiscard]] const calib::estimation::AxisTravel& travel() const noexcept { return travel_; }

 private:
  void take_axis(std::size_t axis, double position_m, double since_last_s);

  std::chrono::nanoseconds patience_;
  std::optional<protocol::HostTime> last_at_;
  struct Axis {
    double last_m = 0.0;
    double centre_m = 0.0;  // of the play
  };
  std::array<std::optional<Axis>, 3> axes_{};
  calib::estimation::AxisTravel travel_{};
};

}  // namespace abbe::daemon
