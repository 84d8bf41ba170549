#pragma once
/// Touches points with the measuring machine, one after the other, and keeps the results: the
/// daemon's part of `abbe calibrate artefact`. A job ends at the first touch or approach move that
/// the machine refuses, or when the connection to the machine is lost, because the position of the
/// machine is not known then. When the job is cancelled, or the client has not called look() for
/// kLongestUnwatched, the motion is stopped at once (AbortE) and no further motion is requested;
/// the reason states the position of the tip. The touches made before the end are kept. For the
/// hub's thread only; no call waits.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/sample_source.hpp"
#include "abbe/service/motion_volume.hpp"

namespace abbe::daemon {

/// A checked job of touches.
struct TouchJob {
  /// Limits of one job, far above the some hundred touches of an artefact with ten balls.
  static constexpr std::size_t kMostTouches = 5'000, kMostPlaces = 20'000;

  std::vector<TouchRequest> touches;
  std::vector<drivers::ProbePoint> leave;    ///< retract path after the last touch
  std::vector<protocol::ProbeTrigger> made;  ///< empty, with capacity for the results
};
/// Makes a job. Error Usage if `touches` is empty or exceeds the limits of TouchJob, Refused if a
/// place fails check_places(): then no part of the job is sent to the machine. Any thread.
[[nodiscard]] Result<TouchJob> touch_job(const MotionVolume& volume,
                                         std::vector<TouchRequest> touches,
                                         std::vector<drivers::ProbePoint> leave = {});

class TouchService {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  /// The motion is stopped if no client has called look() for this time: a machine must not
  /// continue to move unsupervised.
  static constexpr std::chrono::seconds kLongestUnwatched{2};

  struct Status {
    bool running = false;
    std::size_t asked = 0;
    /// touches with their position, in the requested order
    std::vector<protocol::ProbeTrigger> touches;
    std::string reason;  ///< reason why the job ended before the last touch; empty: it did not
    /// Outcome of the stop, if the job was cancelled and has ended.
    drivers::IppStop stop = {};
  };

  /// `configured`: the configuration has a measuring machine.
  TouchService(SampleSource& devices, bool configured)
      : devices_(devices), configured_(configured) {}

  /// Position of the machine, m. Refused without a machine and while the machine is not ready.
  [[nodiscard]] Result<std::array<double, 3>> where() const;
  /// Starts a job. Refused without a machine, while another job runs, and while the machine is not
  /// ready. Afterwards `job` holds the memory of the previous job, which the caller destroys.
  [[nodiscard]] Result<void> start(TouchJob&& job);
  /// Stops the present motion. The job counts as running until the machine has stopped, or until it
  /// is known that the stop cannot be confirmed. The reason and `stop` of the status report the
  /// outcome.
  [[nodiscard]] Result<void> cancel();
  /// Call in every cycle. `points_left`: SampleSource::points_left() before the batch was drained.
  /// `seen`: the last fault that the machine reported. Acts as cancel() if look() was not called
  /// for kLongestUnwatched.
  void cycle(const Batch& batch, std::size_t points_left, const std::string& seen, WallTime now);

  /// The status, for the client that started the job. Resets the time of kLongestUnwatched.
  [[nodiscard]] const Status& look();
  [[nodiscard]] const Status& status() const noexcept { return status_; }
  /// True once the motion is being stopped: cycle() then ignores `seen`.
  [[nodiscard]] bool awaits_stop() const noexcept { return stopping_; }

 private:
  void ask_next();
  void leave();
  void stop(std::string reason);
  void stopping(const Batch& batch, std::size_t points_left);
  void end(std::string reason);
  [[nodiscard]] std::string stop_text() const;
  [[nodiscard]] std::string tip_text() const;
  [[nodiscard]] std::string release_text() const;

  SampleSource& devices_;
  bool configured_;
  std::vector<TouchRequest> requests_;
  std::size_t next_ = 0;  ///< index of the first request that is not sent yet
  std::vector<drivers::ProbePoint> leave_;
  bool leaving_ = false;
  bool stopping_ = false;
  std::uint64_t stop_number_ = 0;  ///< number that stop_machine() returned
  bool refused_ = false;           ///< the machine refused the present touch
  /// time of the last call of look(); nullopt: it was called since the last cycle
  std::optional<WallTime> looked_;
  Status status_;
};

}  // namespace abbe::daemon
