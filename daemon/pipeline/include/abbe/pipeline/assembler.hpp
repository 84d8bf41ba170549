#pragma once
/// Merges the streams of all devices by host time into snapshots, one per tracker point and one per
/// touch, with the axes interpolated to its instant. A touch that knows the axes itself (latched by
/// the counter card, reported by a measuring machine) keeps them. Points come in their order,
/// touches in theirs.
///
/// Tracker points arrive in bursts, up to a third of a second late; axis samples arrive at once. A
/// point is assembled as soon as three axis samples at or after its instant are there: the
/// interpolation uses two on either side, and with the third nobody takes the second back any more.
/// If they do not come, it is assembled from what there is, flagged AxisMissing if that is not
/// enough, once any stream has advanced `watermark` beyond it. Both rules look at the times in the
/// samples only, and an axis or environment sample that comes after a later one is put in its
/// place, so neither the order of arrival (within the watermark) nor the speed of a replay changes
/// a result. Tracker points are given back in the order they were taken in. Ordinary world; not
/// thread-safe.

#include <chrono>
#include <deque>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/drivers/interpolation.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/environment_use.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct AssemblerOptions {
  /// how far a stream may lag behind the others
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
  /// Snapshots that are complete, oldest first; appended to `out`.
  void emit(std::vector<protocol::Snapshot>& out);
  /// Everything still held, at the end of a recording.
  void finish(std::vector<protocol::Snapshot>& out);

 private:
  void take(const protocol::AxisSample& sample);
  [[nodiscard]] bool ready(protocol::HostTime t) const;
  [[nodiscard]] protocol::Snapshot assemble(const protocol::TrackerPoint& point) const;
  [[nodiscard]] protocol::Snapshot assemble(const protocol::ProbeTrigger& touch) const;
  [[nodiscard]] protocol::Snapshot begin(const protocol::SampleHead& head) const;
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
};

}  // namespace abbe::daemon
