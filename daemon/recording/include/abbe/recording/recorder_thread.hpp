#pragma once
/// Runs the recorder on its own thread, so that a slow disk never delays the hub. Batches from the
/// hub wait in memory. If more than `most_waiting_bytes` would wait, further batches are dropped
/// and counted until the recorder has taken the waiting ones; the next message of every stream
/// reports the number of dropped ones in lost_before. All functions except dropped() are for the
/// hub's thread, which hands over batches without a lock and never waits for the recorder.
/// dropped() may be called from any thread.

#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/device_names.hpp"
#include "abbe/pipeline/pipeline.hpp"
#include "abbe/recording/recorder.hpp"

namespace abbe::daemon {

struct RecorderThreadOptions {
  RecorderOptions recorder;
  DeviceNames devices;  ///< names of the devices in the recording
  bool raw = true;      ///< true: also record the raw bytes of the devices
  /// The default is enough for two minutes of a stalled disk with axes at 1 kHz and a tracker at
  /// 500 Hz. The size is limited because the memory may be locked.
  std::size_t most_waiting_bytes = 64 << 20;
};

class RecorderThread : public PipelineObserver {
 public:
  [[nodiscard]] static Result<std::unique_ptr<RecorderThread>> start(RecorderThreadOptions options,
                                                                     RecordingInfo info);
  RecorderThread(const RecorderThread&) = delete;
  RecorderThread& operator=(const RecorderThread&) = delete;
  ~RecorderThread() override;  ///< closes the file cleanly

  /// Passes the samples of the batch to the recorder's thread.
  void on_samples(const Batch& batch) override;

  void hand_over(const Batch& batch);
  void hand_over(v1::CalibrationEvent event, protocol::HostTime taken);
  void attach(RecordingAttachment attachment, protocol::HostTime time);

  /// A digest of everything that was handed over before this call. The future is ready once all of
  /// it has been written to the file (not necessarily synced). It reports a broken promise if the
  /// recorder failed.
  [[nodiscard]] std::future<RecordingDigest> digest();
  /// The last status that the recorder reported, at most two of its cycles (40 ms) old. The
  /// reference is valid until the next call.
  [[nodiscard]] const RecorderStatus& status() const;
  /// Age, in wall time, of the oldest message that was handed over and is not yet written to the
  /// file; 0: all are written. Accurate to 50 ms. In normal operation it is at most
  /// RecorderOptions::chunk_period plus one cycle of the recorder. Messages that were dropped or
  /// lost do not count.
  [[nodiscard]] std::chrono::nanoseconds behind(Recorder::WallTime now) const;
  /// Number of messages that were dropped because more than most_waiting_bytes would have waited.
  [[nodiscard]] std::uint64_t dropped() const noexcept;

 private:
  struct State;
  explicit RecorderThread(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
