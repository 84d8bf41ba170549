#pragma once
/// Touches with the measuring machine of [cmm], one after the other, and what came of them: the
/// daemon's part of `abbe calibrate artefact`. It ends at the first touch or way that the machine
/// refuses, or when the machine goes away: then nobody knows any more what stands where. When it is
/// cancelled, or nobody looks on any more, the motion is stopped where it is (AbortE) and nothing
/// moves after it; the reason says where the tip stands. The touches until then are kept. The hub's
/// thread only; no call waits for anything.

#include <array>
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/sample_source.hpp"

namespace abbe::daemon {

/// Where to go first, one place after the other, and then to touch.
struct TouchRequest {
  std::vector<drivers::ProbePoint> way;  ///< `touch` is false
  drivers::ProbePoint point;
};

/// Touches that are ready to be asked for.
struct TouchJob {
  /// Of one job; an artefact of ten balls takes some hundred touches.
  static constexpr std::size_t kMostTouches = 5'000, kMostPlaces = 20'000;

  std::vector<TouchRequest> touches;
  std::vector<drivers::ProbePoint> leave;    ///< where to go when all were touched
  std::vector<protocol::ProbeTrigger> made;  ///< empty: room for what comes of them
};
/// Usage with nothing to touch, or with more than one job may hold. Any thread.
[[nodiscard]] Result<TouchJob> touch_job(std::vector<TouchRequest> touches,
                                         std::vector<drivers::ProbePoint> leave = {});

class TouchService {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  /// A machine that nobody watches any more must not go on moving.
  static constexpr std::chrono::seconds kLongestUnwatched{2};

  struct Status {
    bool running = false;
    std::size_t asked = 0;
    std::vector<protocol::ProbeTrigger> touches;  ///< with a position, in the order asked
    std::string reason;  ///< why it ended before the last one; empty: it did not
  };

  /// `configured`: there is a [cmm].
  TouchService(SampleSource& devices, bool configured)
      : devices_(devices), configured_(configured) {}

  /// Where the machine stands, m; refused without [cmm] and while it is not ready.
  [[nodiscard]] Result<std::array<double, 3>> where() const;
  /// Refused without [cmm], while touches are under way, and while the machine is not ready. What
  /// the job before left is in `job` then: whoever made it destroys that, too.
  [[nodiscard]] Result<void> start(TouchJob&& job);
  /// Stops the motion that is under way; runs until the machine stands.
  [[nodiscard]] Result<void> cancel();
  /// Every turn. `points_left` as it was before the batch was drained; `seen` is what the machine
  /// said last. As cancel() when nobody has looked for kLongestUnwatched.
  void cycle(const Batch& batch, std::size_t points_left, const std::string& seen, WallTime now);

  /// For whoever asked for the touches, and watches the machine.
  [[nodiscard]] const Status& look();
  [[nodiscard]] const Status& status() const noexcept { return status_; }

 private:
  void ask_next();
  void leave();
  void stop(std::string reason);
  void stopping(const Batch& batch, std::size_t points_left);
  void end(std::string reason);
  [[nodiscard]] std::string tip_text() const;
  [[nodiscard]] std::string release_text() const;

  SampleSource& devices_;
  bool configured_;
  std::vector<TouchRequest> requests_;
  std::size_t next_ = 0;  ///< of them; those before were asked for
  std::vector<drivers::ProbePoint> leave_;
  bool leaving_ = false;
  bool stopping_ = false;
  bool refused_ = false;            ///< the one that is under way
  std::optional<WallTime> looked_;  ///< empty: since the last turn
  Status status_;
};

}  // namespace abbe::daemon
