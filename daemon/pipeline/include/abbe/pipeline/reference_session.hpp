#pragma once
/// Datum of each axis from its distance-coded marks, with two cards: one counts the axes live, the
/// other latches them on their marks. Fed with both streams while somebody drives the axes over a
/// few marks; ends axis by axis. Reads no clock and starts no thread: live and replayed alike.
/// Ordinary world; not thread-safe.
///
/// The cards' scans lie beside each other in host time, known to `u_alignment` (each card maps its
/// counted clock to it). At a mark the live counter was somewhere between its least and largest
/// value around that time; every mark narrows the difference of the two counters' zeros. Drive
/// slowly: at 1 mm/s and 1 ms a mark gives it to 2 um.

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/drivers/sampling/counter_alignment.hpp"
#include "abbe/drivers/sampling/mark_traverse.hpp"
#include "abbe/drivers/sampling/mark_watcher.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct ReferenceAxis {
  std::string name;               ///< "X"
  std::uint8_t live_axis = 0;     ///< place in the live card's samples
  std::uint8_t latched_axis = 0;  ///< place in the latching card's
  drivers::MarkTraverseOptions
      marks;              ///< `counts_per_period` with the sign of the live card's step
  double period = 20e-6;  ///< of the scale's signal, m or rad
  double max_half_width_counts = 0.75;  ///< how well the difference of the zeros must be known
};

struct ReferenceOptions {
  std::vector<ReferenceAxis> axes;
  std::chrono::nanoseconds u_alignment = std::chrono::milliseconds{1};
};

struct AxisReference {
  enum class State : std::uint8_t { Searching, Found, Failed };
  State state = State::Searching;
  std::size_t marks = 0;
  /// m or rad: the reading at the live counter's zero, relative to the scale's zero mark
  double offset = 0.0;
  double u_offset = 0.0;
  std::string reason;  ///< of the latest refusal, or why it failed
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
    std::optional<drivers::MarkDatum> datum;
    AxisReference result;
    protocol::HostTime followed{};  ///< positions until then went to the traverse
  };

  void work();
  void cross(Axis& axis, const drivers::MarkCrossing& crossing);
  void follow(Axis& axis, protocol::HostTime until);
  void conclude(Axis& axis);
  void restart(Axis& axis);

  ReferenceOptions options_;
  std::vector<Axis> axes_;
  std::deque<protocol::AxisSample> live_;
  std::deque<drivers::MarkCrossing> waiting_;
};

/// What a session looks for, from the two cards' wiring.
[[nodiscard]] ReferenceOptions reference_options(const ReferenceConfig& config,
                                                 const CounterCardConfig& live);

/// What a found axis says of count 0. m or rad.
[[nodiscard]] double reading_at_zero(const ReferenceAxisConfig& marks, const AxisReference& found);

/// The request to take the present place of axes without marks as the one where they read their
/// offset.
struct SetDatumHere {
  static constexpr double kByEye = 100e-6;

  std::vector<std::string> axes;  ///< none: all that have no marks
  double u = kByEye;              ///< standard uncertainty of that, m or rad
  protocol::HostTime now{};
  std::chrono::nanoseconds patience{
      std::chrono::milliseconds{500}};  ///< an older sample is not where they are
  bool acquiring = false;               ///< a calibration takes readings
};

}  // namespace abbe::daemon
