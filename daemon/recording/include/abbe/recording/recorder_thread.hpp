#pragma once
/// The recorder on a thread of its own, so that a slow disk never holds up the hub. What the hub
/// hands over waits in memory; when more than `most_waiting_bytes` would wait, further batches are
/// dropped and counted until the recorder has taken what waits, and the next message of every
/// stream says in lost_before how many it were. All functions are for one thread, the hub's: it
/// hands over without a lock and never waits for the recorder. Only dropped() is for any thread.

#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/pipeline.hpp"
#include "abbe/recording/recorder.hpp"

namespace abbe::daemon {

struct RecorderThreadOptions {
  RecorderOptions recorder;
  std::string tracker = "tracker";  ///< device names in the recording
  std::string encoder = "encoder";
  std::string probe = "probe";           ///< the touch probe, or the measuring machine
  std::vector<std::string> environment;  ///< in the order of Config::environment
  std::vector<std::string> devices;      ///< Batch::raw counts them
  bool raw = true;                       ///< record the device bytes, too
  /// Two minutes of a stalled disk with axes at 1 kHz and a tracker at 500 Hz. The memory may be
  /// locked.
  std::size_t most_waiting_bytes = 64 << 20;
};

class RecorderThread : public PipelineObserver {
 public:
  [[nodiscard]] static Result<std::unique_ptr<RecorderThread>> start(RecorderThreadOptions options,
                                                                     RecordingInfo info);
  RecorderThread(const RecorderThread&) = delete;
  RecorderThread& operator=(const RecorderThread&) = delete;
  ~RecorderThread() override;  ///< closes the file cleanly

  /// Hands over what the batch holds.
  void on_samples(const Batch& batch) override;

  void hand_over(const Batch& batch);
  void hand_over(v1::CalibrationEvent event, protocol::HostTime taken);
  void attach(RecordingAttachment attachment, protocol::HostTime time);

  /// Everything handed over before this call is on its way to the disk when the future is ready. A
  /// broken promise if the recorder failed at it.
  [[nodiscard]] std::future<RecordingDigest> digest();
  /// As the recorder reported it last, at most two of its turns (40 ms) ago. Valid until the next
  /// call.
  [[nodiscard]] const RecorderStatus& status() const;
  [[nodiscard]] std::uint64_t dropped()
      const noexcept;  ///< messages handed over for which there was no room

 private:
  struct State;
  explicit RecorderThread(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
