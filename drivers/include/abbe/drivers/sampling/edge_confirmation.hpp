#pragma once
/// Decides which edges of a probe signal are touches. The time of the first edge is kept until the
/// signal was stable for the confirmation time. Times are counts of the card's clock. Real time;
/// one thread.
///
///   Armed --edge--> Pending --signal stable--> Touched --rearm()--> Armed
///                      \--signal not stable--> Armed, or Pending with the later edge
///
/// An edge counter without debounce counts rising edges only: the signal counts as stable if no
/// further rising edge follows. A single pulse shorter than the confirmation time is then taken for
/// a touch; a debounce of the counter avoids this.

#include <cstdint>

#include "abbe/protocol/rt.hpp"

namespace abbe::drivers {

/// Interval of the card's clock that contains an edge: [from, to]. `latched`: the interval comes
/// from the latch; otherwise from the scans before and after the edge.
struct EdgeInterval {
  std::int64_t from = 0;
  std::int64_t to = 0;
  bool latched = false;
};

/// All in counts of the card's clock.
struct EdgeRules {
  std::int64_t confirm = 0;
  std::int64_t chatter = 0;
  bool counter_debounced = false;  ///< counted edges were stable for `confirm`
};

class EdgeConfirmation {
 public:
  enum class State : std::uint8_t { Armed, Pending, Touched };
  enum class Event : std::uint8_t { Nothing, Began, Dismissed, Confirmed };

  explicit EdgeConfirmation(const EdgeRules& rules) noexcept : rules_(rules) {}

  /// Call it for a scan without an edge.
  [[nodiscard]] Event on_time(std::int64_t now) ABBE_RT;
  /// Call it for a scan with rising edges, the last at `edge`. `several`: there was more than one
  /// edge.
  [[nodiscard]] Event on_edge(const EdgeInterval& edge, bool several) ABBE_RT;
  /// For debounced counters: to be called for a scan in which the edge counter has counted. `edge`:
  /// interval of the edge, used if no latch has shown this edge before.
  [[nodiscard]] Event on_counted(const EdgeInterval& edge) ABBE_RT;

  void rearm() ABBE_RT;

  [[nodiscard]] State state() const ABBE_RT { return state_; }
  [[nodiscard]] const EdgeInterval& first() const ABBE_RT { return first_; }
  [[nodiscard]] bool chattered() const ABBE_RT { return chattered_; }
  /// The latest edge, in any state.
  [[nodiscard]] std::int64_t last_edge() const ABBE_RT { return last_edge_; }

 private:
  [[nodiscard]] Event begin(const EdgeInterval& edge, bool several) ABBE_RT;
  [[nodiscard]] Event confirm() ABBE_RT;

  EdgeRules rules_;
  State state_ = State::Armed;
  EdgeInterval first_;
  bool chattered_ = false;
  std::int64_t last_edge_ = 0;
};

}  // namespace abbe::drivers
