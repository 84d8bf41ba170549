#pragma once
/// Finds the zero of each axis from its distance-coded marks. Two cards count the same axes: the
/// live card is read all the time, the other card latches its counts at the marks. This class takes
/// the samples of both cards while the operator moves the axes over a few marks. The search ends
/// separately for each axis. Reads no clock and starts no thread, so that a replay gives the
/// results of the live run. Not for the RT path; not thread-safe.
///
/// Each card maps its counted clock to host time, so that the scans of the two cards are aligned
/// with a standard uncertainty u_alignment. At a mark, the live count is between its smallest and
/// its largest value within u_alignment of the crossing. Every mark therefore narrows the interval
/// that contains the difference between the zeros of the two counters. The axes should move slowly:
/// at 1 mm/s and u_alignment = 1 ms, one mark gives the difference to 2 um.

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/capabilities.hpp"
#include "abbe/drivers/sampling/counter_alignment.hpp"
#include "abbe/drivers/sampling/mark_traverse.hpp"
#include "abbe/drivers/sampling/mark_watcher.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct ReferenceAxis {
  std::string name;               ///< "X"
  std::uint8_t live_axis = 0;     ///< index in the live card's samples
  std::uint8_t latched_axis = 0;  ///< index in the latching card's samples
  /// `counts_per_period` has the sign of the live card's step
  drivers::MarkTraverseOptions marks;
  double period = 20e-6;  ///< signal period of the scale, m or rad
  /// An axis is Found once the half width of the interval that contains the difference between the
  /// zeros of the two counters is at most this.
  double max_half_width_counts = 0.75;
};

struct ReferenceOptions {
  std::vector<ReferenceAxis> axes;
  std::chrono::nanoseconds u_alignment = std::chrono::milliseconds{1};
};

struct AxisReference {
  enum class State : std::uint8_t { Searching, Found, Failed };
  State state = State::Searching;
  std::size_t marks = 0;
  /// reading (m or rad) at count 0 of the live counter, relative to the zero mark of the scale
  double offset = 0.0;
  double u_offset = 0.0;
  /// reason why the latest mark did not give the zero, or why the search failed
  std::string reason;
};

class ReferenceSession {
 public:
  explicit ReferenceSession(ReferenceOptions options);

  void take(const protocol::AxisSample& live);
  void take(const drivers::MarkCrossing& crossing);

  [[nodiscard]] const AxisReference& axis(std::size_t i) const { return axes_[i].result; }
  [[nodiscard]] bool finished() const;
  [[nodiscard]] const ReferenceOptions& options() const noexcept { return options_; }

 private:
  struct Axis {
    ReferenceAxis options;
    drivers::MarkTraverse traverse;
    drivers::CounterAlignment alignment;
    std::optional<drivers::MarkZero> zero;
    AxisReference result;
    /// the samples up to this time have been evaluated for the traverse
    protocol::HostTime followed{};
  };

  void process_crossings();
  void cross(Axis& axis, const drivers::MarkCrossing& crossing);
  void follow(Axis& axis, protocol::HostTime until);
  void conclude(Axis& axis);
  void restart(Axis& axis);

  ReferenceOptions options_;
  std::vector<Axis> axes_;
  std::deque<protocol::AxisSample> live_;
  std::deque<drivers::MarkCrossing> waiting_;
};

/// Options of a session, from the wiring of the two cards.
[[nodiscard]] ReferenceOptions reference_options(const ReferenceMarks& found,
                                                 const CountedAxes& live);

/// Reading at count 0 of an axis in state Found, m or rad.
[[nodiscard]] double reading_at_zero(const AxisMarks& marks, const AxisReference& found);

/// Request to set the zero of axes without marks: the current position of each axis is defined as
/// the one at which the axis reads its configured offset.
struct SetZeroHere {
  /// m or rad; for an axis that the operator has positioned by eye
  static constexpr double kByEye = 100e-6;

  std::vector<std::string> axes;  ///< empty: all axes without marks
  double u = kByEye;              ///< standard uncertainty of the position, m or rad
  protocol::HostTime now{};
  /// largest age of the axis sample that is used as the current position
  std::chrono::nanoseconds patience{std::chrono::milliseconds{500}};
  bool acquiring = false;  ///< true: a calibration is taking readings
};

}  // namespace abbe::daemon
