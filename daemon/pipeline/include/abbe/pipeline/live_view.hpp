#pragma once
/// The latest samples of all streams, for displays: the axes at the latest SYNC, the latest tracker
/// point (up to a third of a second older) and the latest environment values. The samples are not
/// interpolated to one instant, and identification does not use them. Not for the RT path; not
/// thread-safe.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abbe/drivers/time_source.hpp"
#include "abbe/pipeline/assembler.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/environment_use.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// If no axis sample has arrived for this time (wall time, also with simulated devices), the axis
/// positions are not known.
inline constexpr std::chrono::milliseconds kAxesTimeout{500};

/// True if the positions of X, Y and Z in a live view are valid at the instant of the view: all
/// axes have sent a sample, and neither the bus nor a node has a fault. If false, the positions are
/// the last known ones and older than the view.
[[nodiscard]] bool axes_known(const protocol::Snapshot& view) noexcept;

class LiveView {
 public:
  LiveView(const AssemblerOptions& options, const drivers::TimeSource& time);

  /// Updates the view. True if it has changed: new samples have arrived, or a value has become too
  /// old at `batch.taken`. Tracker point and touch are removed after 1 s, and all axes are marked
  /// missing after kAxesTimeout.
  bool take(const Batch& batch);
  [[nodiscard]] const protocol::Snapshot& view() const noexcept { return view_; }
  /// The sensors whose readings are not used.
  [[nodiscard]] std::vector<SensorFinding> sensor_findings() const {
    return environment_.findings();
  }
  [[nodiscard]] const SensorChecks& sensors() const noexcept { return environment_.sensors(); }
  void accept(SensorAcceptance acceptance) { environment_.accept(std::move(acceptance)); }
  /// Continues from the state of the sensors in an earlier run.
  [[nodiscard]] Result<void> go_on(const RecordingAttachment& sensor_state) {
    return environment_.go_on(sensor_state);
  }
  [[nodiscard]] std::vector<SensorDoubts> sensor_doubts() const { return environment_.doubts(); }
  /// For each axis: why the correction for the temperature of its scale is missing; empty: it is
  /// not missing. Same order as Snapshot::position.
  [[nodiscard]] std::vector<std::string> missing_scales() const;
  /// The reasons of missing_scales() with the names of the axes, if X, Y or Z is missing only for
  /// such a reason. Empty: no axis is missing, or a reading itself is missing.
  [[nodiscard]] std::string why_scales_alone_are_missing() const;
  /// Instant of the latest axis sample, even if axes are missing in that sample.
  [[nodiscard]] std::optional<protocol::HostTime> axes_at() const noexcept {
    return previous_ ? std::optional{previous_->head.time} : std::nullopt;
  }
  /// Latest instant at which axes_known() was true; nullopt: never yet.
  [[nodiscard]] std::optional<protocol::HostTime> axes_known_at() const noexcept {
    return axes_known_at_;
  }

 private:
  void take(const protocol::AxisSample& sample);
  bool forget_what_is_not_current(protocol::HostTime now);
  bool mark_axes_missing(protocol::HostTime now);

  drivers::InterpolationOptions interpolation_;
  EnvironmentUseOptions use_;
  EnvironmentMerge environment_;
  std::chrono::nanoseconds current_for_, axes_patience_;
  protocol::Snapshot view_{};
  std::uint8_t without_reading_ = 0;  ///< missing_mask before the correction for temperature
  std::optional<protocol::AxisSample> previous_;
  std::optional<protocol::HostTime> axes_known_at_;
};

}  // namespace abbe::daemon
