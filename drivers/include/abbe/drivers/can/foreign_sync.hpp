#pragma once
/// The SYNC of another producer: whether there is one on this bus, and its period. Sans-I/O. One
/// thread.
///
/// A bus with two SYNC producers is broken for both, and nodes that another master has configured
/// are not ours: nothing at all is sent on a bus before it was listened to for kListenFor each time
/// it was opened or came back from bus-off, and nothing while another SYNC was heard within the
/// last kQuietFor of an open bus. After a break shorter than kShortBreak of a bus that was ours
/// kListenAgainFor is enough.

#include <chrono>
#include <cstdint>
#include <optional>

#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

class ForeignSync {
 public:
  /// Slow producers send a SYNC every second: an older position is of no use to a control. Half a
  /// second more for a tunnel that holds frames back (cannelloni: 0.1 s) and for a SYNC that is
  /// late itself.
  static constexpr std::chrono::nanoseconds kListenFor = std::chrono::milliseconds{1500};
  /// A control that restarts its bus finds the nodes as it left them.
  static constexpr std::chrono::nanoseconds kQuietFor = std::chrono::seconds{60};

  /// No control starts within this: one that is on the bus now was on it, or was switched on
  /// before.
  static constexpr std::chrono::nanoseconds kShortBreak = std::chrono::seconds{2};
  /// Or three of the longest intervals ever heard on this bus, if that is longer, up to kListenFor.
  /// A slower producer is found by its first SYNC while we send, as one that is connected to an
  /// open bus.
  static constexpr std::chrono::nanoseconds kListenAgainFor = std::chrono::milliseconds{200};

  /// The bus is open, or back from bus-off: what was on it before is not known. Listens, and all
  /// quiet counts from now.
  void opened(protocol::HostTime now);
  void heard(protocol::HostTime at);
  /// All that came until `now` was handed to heard().
  [[nodiscard]] bool may_send(protocol::HostTime now);
  /// When may_send() may become true; HostTime::max() if it is.
  [[nodiscard]] protocol::HostTime deadline() const;

  [[nodiscard]] bool present() const { return count_ > 0; }
  [[nodiscard]] protocol::HostTime last() const { return last_; }
  /// The mean over up to a second in which no SYNC was left out; nullopt before the second SYNC.
  [[nodiscard]] std::optional<std::chrono::nanoseconds> period() const;

 private:
  std::optional<protocol::HostTime> quiet_since_;
  std::chrono::nanoseconds listen_for_ = kListenFor;
  bool may_send_ = false;
  bool restarts_measuring_ = false;  ///< SYNCs of before and after the opening make no interval
  protocol::HostTime heard_until_{};
  std::uint64_t count_ = 0;  ///< since it appeared
  protocol::HostTime first_{}, last_{};
  std::uint64_t intervals_ = 0;  ///< since first_
  std::chrono::nanoseconds longest_{};
  std::chrono::nanoseconds slowest_{};  ///< the longest interval ever
  std::optional<std::chrono::nanoseconds> period_;
};

}  // namespace abbe::drivers
