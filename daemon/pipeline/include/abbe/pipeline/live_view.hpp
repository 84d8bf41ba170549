#pragma once
/// The newest of everything, for those who want to see now rather than exactly: the axes as of the
/// latest SYNC, the latest tracker point (up to a third of a second older) and the latest
/// environment. Identification never uses it. Ordinary world; not thread-safe.

#include <chrono>
#include <optional>

#include "abbe/drivers/time_source.hpp"
#include "abbe/pipeline/assembler.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/environment_use.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// Without axis samples for this long (wall time, also with simulated devices) the positions are
/// not known.
inline constexpr std::chrono::milliseconds kAxesTimeout{500};

/// X, Y and Z stand where a live view says, at its instant: all answered, from a bus and nodes
/// without a fault. Else the positions are the last known ones, however fresh the instant looks.
[[nodiscard]] bool axes_known(const protocol::Snapshot& view) noexcept;

class LiveView {
 public:
  LiveView(const AssemblerOptions& options, const drivers::TimeSource& time);

  /// True if anything new came, or something shown is no longer current at `batch.taken`: after 1 s
  /// the tracker point and the touch are forgotten, after kAxesTimeout all axes are missing.
  bool take(const Batch& batch);
  [[nodiscard]] const protocol::Snapshot& view() const noexcept { return view_; }
  /// The instant of the latest axis sample, whatever was missing in it.
  [[nodiscard]] std::optional<protocol::HostTime> axes_at() const noexcept {
    return previous_ ? std::optional{previous_->head.time} : std::nullopt;
  }
  /// The latest instant at which axes_known() held; none yet: nothing.
  [[nodiscard]] std::optional<protocol::HostTime> axes_known_at() const noexcept {
    return axes_known_at_;
  }

 private:
  void take(const protocol::AxisSample& sample);
  void take_back(const protocol::AxisSample& sample);
  bool forget_what_is_not_current(protocol::HostTime now);
  bool mark_axes_missing(protocol::HostTime now);

  drivers::InterpolationOptions interpolation_;
  EnvironmentUseOptions use_;
  EnvironmentMerge environment_;
  std::chrono::nanoseconds current_for_, axes_patience_;
  protocol::Snapshot view_{};
  std::optional<protocol::AxisSample> previous_;
  std::optional<protocol::HostTime> axes_known_at_;
};

}  // namespace abbe::daemon
