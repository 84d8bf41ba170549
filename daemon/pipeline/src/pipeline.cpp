#include "abbe/pipeline/pipeline.hpp"

#include <utility>

namespace abbe::daemon {

Pipeline::Pipeline(AssemblerOptions options, AxisZeros* zeros)
    : zeros_(zeros), assembler_(std::move(options)) {}

void Pipeline::cycle(Batch& batch) {
  for (PipelineObserver* const observer : observers_) observer->on_delivered(batch);
  if (zeros_ != nullptr) zeros_->apply(batch);
  for (PipelineObserver* const observer : observers_) observer->on_samples(batch);

  assembler_.take(batch);
  assembler_.emit(snapshots_);
  report_snapshots(batch.taken);
}

void Pipeline::finish(protocol::HostTime taken) {
  assembler_.finish(snapshots_);
  report_snapshots(taken);
}

void Pipeline::report_snapshots(protocol::HostTime taken) {
  for (PipelineObserver* const observer : observers_) observer->on_snapshots(snapshots_, taken);
  snapshots_.clear();
}

}  // namespace abbe::daemon
