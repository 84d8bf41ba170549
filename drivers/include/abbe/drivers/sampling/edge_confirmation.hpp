#pragma once
/// Which edges of a probe's signal are touches. The time of the first edge is kept; whether it was
/// a touch is decided later. Times are counts of the card's clock. Real time; one thread.
///
///   Armed --edge--> Pending --stands--> Touched --rearm()--> Armed
///                      \--did not stand--> Armed, or Pending with the later edge
///
/// An edge counter that is not debounced sees rising edges only: that the signal stands means that
/// no further edge came. A single pulse shorter than the confirmation cannot be told from a touch;
/// debounce the counter where that matters.

#include <cstdint>

#include "abbe/protocol/rt.hpp"

namespace abbe::drivers {

/// Where an edge lies on the card's clock: in [from, to]. Latched: from and to are the latch's own
/// width.
struct EdgeInterval {
  std::int64_t from = 0;
  std::int64_t to = 0;
  bool latched = false;
};

/// All in counts of the card's clock.
struct EdgeRules {
  std::int64_t confirm = 0;
  std::int64_t chatter = 0;
  bool counter_debounced = false;  ///< an edge that is counted has stood for `confirm`
};

class EdgeConfirmation {
 public:
  enum class State : std::uint8_t { Armed, Pending, Touched };
  enum class Event : std::uint8_t { Nothing, Began, Dismissed, Confirmed };

  explicit EdgeConfirmation(const EdgeRules& rules) noexcept : rules_(rules) {}

  /// One scan without news.
  [[nodiscard]] Event on_time(std::int64_t now) ABBE_RT;
  /// One scan in which the signal rose, last at `edge`; `several`: more than once.
  [[nodiscard]] Event on_edge(const EdgeInterval& edge, bool several) ABBE_RT;
  /// Debounced counters: one scan in which the counter counted. `edge`: where it must have been if
  /// no latch showed it before.
  [[nodiscard]] Event on_counted(const EdgeInterval& edge) ABBE_RT;

  void rearm() ABBE_RT;

  [[nodiscard]] State state() const ABBE_RT { return state_; }
  [[nodiscard]] const EdgeInterval& first() const ABBE_RT { return first_; }
  [[nodiscard]] bool chattered() const ABBE_RT { return chattered_; }
  /// The latest edge that was seen, in any state.
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
