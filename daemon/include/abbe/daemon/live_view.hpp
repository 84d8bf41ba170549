#pragma once
/// The newest of everything, for those who want to see now rather than exactly: the axes as of the latest
/// SYNC, the latest tracker point (up to a third of a second older) and the latest environment.
/// Identification never uses it. Ordinary world; not thread-safe.

#include <optional>

#include "abbe/daemon/assembler.hpp"
#include "abbe/daemon/batch.hpp"
#include "abbe/daemon/environment_use.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// X, Y and Z stand where a live view says, at its instant: all answered, from a bus and nodes without a
/// fault. Else the positions are the last known ones, however fresh the instant looks.
[[nodiscard]] bool axes_known(const protocol::Snapshot& view) noexcept;

class LiveView {
 public:
  explicit LiveView(const AssemblerOptions& options)
      : interpolation_(options.interpolation), use_(options.environment), environment_(use_, {}) {
    view_.axes_compensated = options.axes_compensated;
  }

  /// True if anything new came.
  bool take(const Batch& batch);
  [[nodiscard]] const protocol::Snapshot& view() const noexcept { return view_; }
  /// The instant of the latest axis sample, whatever was missing in it.
  [[nodiscard]] std::optional<protocol::HostTime> axes_at() const noexcept {
    return previous_ ? std::optional{previous_->head.time} : std::nullopt;
  }
  /// The latest instant at which axes_known() held; none yet: nothing.
  [[nodiscard]] std::optional<protocol::HostTime> axes_known_at() const noexcept { return axes_known_at_; }

 private:
  void take(const protocol::AxisSample& sample);
  void take_back(const protocol::AxisSample& sample);

  drivers::InterpolationOptions interpolation_;
  EnvironmentUseOptions use_;
  EnvironmentMerge environment_;
  protocol::Snapshot view_{};
  std::optional<protocol::AxisSample> previous_;
  std::optional<protocol::HostTime> axes_known_at_;
};

}  // namespace abbe::daemon
