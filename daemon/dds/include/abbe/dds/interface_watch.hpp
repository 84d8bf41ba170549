#pragma once
/// Detects addresses that a network interface gets while a DDS participant runs: a cable is plugged
/// in, DHCP assigns an address, or the program started before the network was up. Fast DDS 2.9 does
/// not use such addresses, not even when the QoS of the participant is set again: writers and
/// readers keep the addresses that existed when they were created. The participant has to be
/// created again, in a new process image, because Fast DDS never gives a participant id (and with
/// it the port) twice to one process.

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "abbe/dds/interface_address.hpp"

namespace abbe::dds {

/// For one thread. Where rtnetlink(7) is not available, for example in a sandbox, no address is
/// detected.
class InterfaceWatch {
 public:
  using Clock = std::chrono::steady_clock;
  /// Changes are evaluated once no further change has come for this time: an interface that comes
  /// up gets its addresses one after the other, and its link may drop a few times while a cable is
  /// plugged in.
  static constexpr std::chrono::milliseconds kSettles{500};
  /// Changes are evaluated at the latest this time after the first change, because interfaces may
  /// change without end, for example while containers start and stop.
  static constexpr std::chrono::seconds kLongestWait{5};
  /// cycle() reports no address before the watch has existed for this time. A report restarts
  /// abbe-dds, which must publish for a while even if interfaces change all the time.
  static constexpr std::chrono::seconds kShortestLife{5};

  /// Create the watch before the participant: an address that appears after the participant was
  /// created is then reported.
  explicit InterfaceWatch(Clock::time_point now);
  ~InterfaceWatch();
  InterfaceWatch(const InterfaceWatch&) = delete;
  InterfaceWatch& operator=(const InterfaceWatch&) = delete;

  /// Returns a new address for which the participant has to be created again. "New": its interface
  /// is running, the profile allows it (`allowed`; empty: all addresses), and neither the
  /// constructor nor an earlier call has found it. Never blocks.
  [[nodiscard]] std::optional<std::string> cycle(const std::vector<std::string>& allowed,
                                                 Clock::time_point now);

 private:
  int netlink_ = -1;
  Clock::time_point begun_;
  /// times of the first and the last change since the interfaces were last read
  std::optional<Clock::time_point> first_change_, last_change_;
  std::vector<InterfaceAddress> known_;  ///< sorted
};

}  // namespace abbe::dds
