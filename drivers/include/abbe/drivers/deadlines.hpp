#pragma once
/// The deadlines of one state machine: for each purpose at most one instant, at which the machine
/// must act unless this deadline is set again or cancelled before. next() states when the machine
/// acts next, passed() for which purpose. Time is handed in. No allocation; usable in real time.
/// One thread.
///
/// `kLast` is the last enumerator of the purposes, whose values are 0, 1, 2 ... If several
/// deadlines have passed, the purpose that is declared first comes first, whichever passed earlier.

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

template <auto kLast>
class Deadlines {
 public:
  using Purpose = decltype(kLast);
  using HostTime = protocol::HostTime;

  Deadlines() ABBE_RT { cancel_all(); }

  /// Sets the deadline of `purpose`; it replaces an earlier one.
  void set(Purpose purpose, HostTime at) ABBE_RT { at_[index(purpose)] = at; }
  void cancel(Purpose purpose) ABBE_RT { at_[index(purpose)] = kNever; }
  void cancel_all() ABBE_RT { at_.fill(kNever); }

  /// kNever if it is not set.
  [[nodiscard]] HostTime at(Purpose purpose) const ABBE_RT { return at_[index(purpose)]; }
  [[nodiscard]] bool is_set(Purpose purpose) const ABBE_RT { return at(purpose) != kNever; }
  /// Set, and not reached at `now`.
  [[nodiscard]] bool ahead(Purpose purpose, HostTime now) const ABBE_RT {
    return is_set(purpose) && now < at(purpose);
  }

  /// The earliest deadline; kNever if there is none. Deadlines of the purposes in `waiting` stay
  /// set, but are not considered: another event must happen before they can be acted on.
  [[nodiscard]] HostTime next(std::span<const Purpose> waiting = {}) const ABBE_RT {
    HostTime earliest = kNever;
    for (std::size_t i = 0; i < at_.size(); ++i) {
      if (!contains(waiting, i)) earliest = std::min(earliest, at_[i]);
    }
    return earliest;
  }
  /// The purpose whose deadline has passed at `now`. The deadline stays set: the code that handles
  /// it sets it again or cancels it.
  [[nodiscard]] std::optional<Purpose> passed(HostTime now,
                                              std::span<const Purpose> waiting = {}) const ABBE_RT {
    for (std::size_t i = 0; i < at_.size(); ++i) {
      if (at_[i] != kNever && now >= at_[i] && !contains(waiting, i))
        return static_cast<Purpose>(i);
    }
    return std::nullopt;
  }

  static constexpr HostTime kNever = HostTime::max();

 private:
  static constexpr std::size_t index(Purpose purpose) ABBE_RT {
    return static_cast<std::size_t>(purpose);
  }
  static bool contains(std::span<const Purpose> purposes, std::size_t i) ABBE_RT {
    return std::ranges::find(purposes, static_cast<Purpose>(i)) != purposes.end();
  }

  std::array<HostTime, index(kLast) + 1> at_;
};

}  // namespace abbe::drivers
