#pragma once
/// Processing steps for the samples of one cycle, the same live (in the hub) and in a replay:
///
///   1. observers see the batch as the devices delivered it (search for reference marks)
///   2. every axis reading gets its zero, the reading at count 0; an axis that is not
///      referenced is marked missing
///   3. observers see the samples (live view, publisher, recorder)
///   4. samples are assembled to snapshots: axes are interpolated to the instant of each tracker
///      point and touch, readings of the environment sensors are checked, axis readings are
///      corrected for the temperature of the scales, ranges for the refractive index of the air
///   5. observers see the snapshots (calibration session, verification)
///
/// The order of the steps is defined in this class only. Deterministic: reads no clock, so that a
/// replay of the same batches gives the same snapshots. Not for the RT path; one thread.

#include <span>
#include <utility>
#include <vector>

#include "abbe/pipeline/assembler.hpp"
#include "abbe/pipeline/axis_zero.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// An observer overrides the functions of the steps in which it takes part. Within a step,
/// observers are called in the order in which they were added.
class PipelineObserver {
 public:
  PipelineObserver() = default;
  virtual ~PipelineObserver() = default;

  /// Step 1. If the observer finds a zero, it already applies to the samples of this batch.
  virtual void on_delivered(const Batch&) {}
  /// Step 3. Called in every cycle, also with an empty batch.
  virtual void on_samples(const Batch&) {}
  /// Step 5. Called in every cycle, also without snapshots. `taken`: Batch::taken.
  virtual void on_snapshots(std::span<const protocol::Snapshot>, protocol::HostTime /*taken*/) {}

 protected:
  PipelineObserver(const PipelineObserver&) = default;
  PipelineObserver& operator=(const PipelineObserver&) = default;
  PipelineObserver(PipelineObserver&&) = default;
  PipelineObserver& operator=(PipelineObserver&&) = default;
};

class Pipeline {
 public:
  /// `zeros`: null if the readings in the batches have their zero already, as in a recording.
  Pipeline(AssemblerOptions options, AxisZeros* zeros);

  /// The observer must outlive the pipeline.
  void add(PipelineObserver& observer) { observers_.push_back(&observer); }

  /// The acceptance applies to the readings after its instant.
  void accept(SensorAcceptance acceptance) { assembler_.accept(std::move(acceptance)); }
  /// Sets the state of the environment sensors before the first sample: in a replay that of the
  /// previous file, live that of an earlier run.
  [[nodiscard]] Result<void> go_on(const RecordingAttachment& sensor_state) {
    return assembler_.go_on(sensor_state);
  }

  /// Steps 1 to 5. Changes the readings in `batch` (step 2).
  void cycle(Batch& batch);
  /// Steps 4 and 5 for all pending samples, at the end of a recording.
  void finish(protocol::HostTime taken);

 private:
  void report_snapshots(protocol::HostTime taken);

  AxisZeros* zeros_;
  Assembler assembler_;
  std::vector<PipelineObserver*> observers_;
  std::vector<protocol::Snapshot> snapshots_;  // reused, so that only the first cycles allocate
};

}  // namespace abbe::daemon
