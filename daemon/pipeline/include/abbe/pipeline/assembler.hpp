#pragma once
/// Merges the streams of all devices by host time into snapshots, one per tracker point and one per
/// touch, with the axes interpolated to the instant of the point or touch. A touch that contains
/// axis positions (latched by the counter card, reported by a measuring machine) keeps them. Points
/// keep their order of arrival, and so do touches.
///
/// Tracker points arrive in bursts, up to a third of a second late; axis samples arrive without
/// delay. A point is assembled as soon as three axis samples at or after its instant have arrived.
/// The interpolation uses two on either side; the third is awaited because after a bus-off a sample
/// may be earlier than the one that arrived before it. If these samples do not arrive, the point is
/// assembled from the available ones once any stream has advanced by `watermark` beyond the point;
/// the snapshot is flagged AxisMissing if they are too few. Both rules use only the times in the
/// samples, and an axis or environment sample that arrives late is inserted by its time. Therefore
/// neither the order of arrival (within the watermark) nor the speed of a replay changes a result.
/// Not for the RT path; not thread-safe.

#include <chrono>
#include <deque>
#include <utility>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/drivers/interpolation.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/environment_use.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct AssemblerOptions {
  /// largest time by which a stream may lag behind the other streams
  std::chrono::nanoseconds watermark = std::chrono::milliseconds{600};
  drivers::InterpolationOptions interpolation;
  bool axes_compensated = false;  ///< the readings are already corrected by the control
  EnvironmentUseOptions environment;
};

[[nodiscard]] AssemblerOptions assembler_options(const Config& config);

class Assembler {
 public:
  explicit Assembler(AssemblerOptions options);

  void take(const Batch& batch);
  /// Appends the complete snapshots to `out`, oldest first.
  void emit(std::vector<protocol::Snapshot>& out);
  void accept(SensorAcceptance acceptance) { environment_.accept(std::move(acceptance)); }
  /// Sets the state of the environment sensors before the first sample: in a replay that of the
  /// previous file, live that of an earlier run.
  [[nodiscard]] Result<void> go_on(const RecordingAttachment& sensor_state) {
    return environment_.go_on(sensor_state);
  }
  /// Appends the snapshots of all pending points and touches, at the end of a recording.
  void finish(std::vector<protocol::Snapshot>& out);

 private:
  void take(const protocol::AxisSample& sample);
  [[nodiscard]] bool ready(protocol::HostTime t) const;
  [[nodiscard]] protocol::Snapshot assemble(const protocol::TrackerPoint& point);
  [[nodiscard]] protocol::Snapshot assemble(const protocol::ProbeTrigger& touch);
  [[nodiscard]] protocol::Snapshot begin(const protocol::SampleHead& head);
  void interpolate(protocol::Snapshot& snapshot) const;
  void emit_first_point(std::vector<protocol::Snapshot>& out);
  void emit_first_touch(std::vector<protocol::Snapshot>& out);
  void forget();

  AssemblerOptions options_;
  std::deque<protocol::TrackerPoint> points_;
  std::deque<protocol::ProbeTrigger> touches_;
  std::deque<protocol::AxisSample> axes_;
  EnvironmentMerge environment_;
  protocol::HostTime newest_{};
  /// Samples with a later time are invalid: such a time neither makes other streams late nor is
  /// waited for.
  protocol::HostTime latest_ = protocol::HostTime::max();
};

}  // namespace abbe::daemon
