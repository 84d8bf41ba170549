#pragma once
/// The recorder on a thread of its own, so that a slow disk never holds up the hub. What the hub hands over
/// waits in memory; when more than `most_waiting` samples wait, further ones are dropped, counted, and said
/// in status(). Functions may be called from any thread.

#include <cstdint>
#include <future>
#include <memory>
#include <string>

#include "abbe/daemon/batch.hpp"
#include "abbe/daemon/recorder.hpp"

namespace abbe::daemon {

struct RecorderThreadOptions {
  RecorderOptions recorder;
  std::string tracker = "tracker";  ///< device names in the recording
  std::string encoder = "encoder";
  bool raw = true;                       ///< record the device bytes, too
  std::size_t most_waiting = 1'000'000;  ///< samples; minutes of a stalled disk at 1.5 kHz
};

class RecorderThread {
 public:
  [[nodiscard]] static Result<std::unique_ptr<RecorderThread>> start(RecorderThreadOptions options,
                                                                     RecordingInfo info);
  RecorderThread(const RecorderThread&) = delete;
  RecorderThread& operator=(const RecorderThread&) = delete;
  ~RecorderThread();  ///< closes the file cleanly

  void hand_over(const Batch& batch);
  void hand_over(v1::CalibrationEvent event);
  void attach(RecordingAttachment attachment, protocol::HostTime time);

  /// Everything handed over before this call is on its way to the disk when the future is ready.
  [[nodiscard]] std::future<RecordingDigest> digest();
  [[nodiscard]] RecorderStatus status() const;
  [[nodiscard]] std::uint64_t dropped() const noexcept;  ///< handed over, but not waited for

 private:
  struct State;
  explicit RecorderThread(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
