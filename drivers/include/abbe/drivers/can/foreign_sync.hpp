#pragma once
/// Detects a foreign SYNC, that of another producer on this bus, and measures its period. Sans-I/O.
/// One thread.
///
/// Two SYNC producers disturb each other, and nodes that another master has configured must not be
/// reconfigured. Therefore nothing may be sent
///  - for the first kListenFor after the bus was opened or has recovered from bus-off, and
///  - until the bus was open for kQuietFor without a foreign SYNC, once there was one.
/// After an interruption shorter than kShortBreak of a bus on which sending was permitted,
/// kListenAgainFor replaces kListenFor.

#include <chrono>
#include <cstdint>
#include <optional>

#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

class ForeignSync {
 public:
  /// Listening time after the bus was opened. The slowest producers send a SYNC every second,
  /// because older positions are useless to a control (CNC). The additional 0.5 s cover a tunnel
  /// that delays frames (cannelloni: 0.1 s) and a late SYNC.
  static constexpr std::chrono::nanoseconds kListenFor = std::chrono::milliseconds{1500};
  /// A control (CNC) that restarts within this time finds its nodes unchanged.
  static constexpr std::chrono::nanoseconds kQuietFor = std::chrono::seconds{60};

  /// A control takes longer than this to start. So after a shorter interruption every control on
  /// the bus was on it, or starting, already before the interruption.
  static constexpr std::chrono::nanoseconds kShortBreak = std::chrono::seconds{2};
  /// Listening time after a short interruption. It is extended to three times the longest SYNC
  /// interval ever measured on this bus, up to kListenFor. A foreign SYNC with a longer period is
  /// detected only when its first SYNC arrives, while we already send; so is a producer that is
  /// connected to a bus that is already open.
  static constexpr std::chrono::nanoseconds kListenAgainFor = std::chrono::milliseconds{200};

  /// The bus was opened, or has recovered from bus-off. Listening restarts: time without a SYNC
  /// counts from `now`.
  void opened(protocol::HostTime now);
  void heard(protocol::HostTime at);
  /// Precondition: every SYNC that arrived before `now` was passed to heard().
  [[nodiscard]] bool may_send(protocol::HostTime now);
  /// The time at which may_send() can become true; HostTime::max() if it is true.
  [[nodiscard]] protocol::HostTime deadline() const;

  [[nodiscard]] bool present() const { return count_ > 0; }
  [[nodiscard]] protocol::HostTime last() const { return last_; }
  /// Mean period of the foreign SYNC over at most the latest second without a missing SYNC; nullopt
  /// before the second SYNC.
  [[nodiscard]] std::optional<std::chrono::nanoseconds> period() const;

 private:
  std::optional<protocol::HostTime> quiet_since_;
  std::chrono::nanoseconds listen_for_ = kListenFor;
  bool may_send_ = false;
  bool restarts_measuring_ = false;  ///< the next SYNC starts a new measurement of the period
  protocol::HostTime heard_until_{};
  std::uint64_t count_ = 0;  ///< foreign SYNCs since the first one
  protocol::HostTime first_{}, last_{};
  std::uint64_t intervals_ = 0;  ///< number of intervals since first_
  std::chrono::nanoseconds longest_{};
  std::chrono::nanoseconds slowest_{};  ///< the longest interval since construction
  std::optional<std::chrono::nanoseconds> period_;
};

}  // namespace abbe::drivers
