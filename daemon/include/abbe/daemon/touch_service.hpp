#pragma once
/// Touches with the measuring machine of [cmm], one after the other, and what came of them: the daemon's part
/// of `abbe calibrate artefact`. It ends at the first touch or way that the machine refuses, or when the
/// machine goes away: then nobody knows any more what stands where. It ends, too, when nobody looks on any
/// more. The touches until then are kept. The hub's thread only; no call waits for anything.

#include <array>
#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "abbe/daemon/batch.hpp"
#include "abbe/daemon/error.hpp"
#include "abbe/daemon/sample_source.hpp"

namespace abbe::daemon {

/// Where to go first, one place after the other, and then to touch.
struct TouchRequest {
  std::vector<drivers::ProbePoint> way;  ///< `touch` is false
  drivers::ProbePoint point;
};

class TouchService {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  /// A machine that nobody watches any more must not go on moving.
  static constexpr std::chrono::seconds kLongestUnwatched{2};

  struct Status {
    bool running = false;
    std::size_t asked = 0;
    std::vector<protocol::ProbeTrigger> touches;  ///< with a position, in the order asked
    std::string reason;                           ///< why it ended before the last one; empty: it did not
  };

  /// `configured`: there is a [cmm].
  TouchService(SampleSource& devices, bool configured) : devices_(devices), configured_(configured) {}

  /// Where the machine stands, m; refused without [cmm] and while it is not ready.
  [[nodiscard]] Result<std::array<double, 3>> where() const;
  /// `leave`: where to go when all were touched. Refused without [cmm], while touches are under way, while
  /// the machine is not ready, and with nothing to touch.
  [[nodiscard]] Result<void> start(std::vector<TouchRequest> requests,
                                   std::vector<drivers::ProbePoint> leave = {});
  /// The touch that is under way is still made and kept; it runs until then.
  [[nodiscard]] Result<void> cancel();
  /// Every turn. `points_left` as it was before the batch was drained; `seen` is what the machine said last.
  /// As cancel() when nobody has looked for kLongestUnwatched.
  void turn(const Batch& batch, std::size_t points_left, const std::string& seen, WallTime now);

  /// For whoever asked for the touches, and watches the machine.
  [[nodiscard]] const Status& look();
  [[nodiscard]] const Status& status() const noexcept { return status_; }

 private:
  void ask_next();
  void leave();
  void give_up(std::string reason);
  void end(std::string reason);

  SampleSource& devices_;
  bool configured_;
  std::deque<TouchRequest> waiting_;
  std::vector<drivers::ProbePoint> leave_;
  bool leaving_ = false;
  bool refused_ = false;            ///< the one that is under way
  std::optional<WallTime> looked_;  ///< empty: since the last turn
  Status status_;
};

}  // namespace abbe::daemon
