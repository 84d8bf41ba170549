#pragma once
/// Addresses that a network interface gets while a participant runs: a cable plugged in, DHCP, a
/// boot that was quicker than the network. Fast DDS 2.9 does not take them up, not even when its
/// QoS is set again: its writers and readers keep the addresses of their creation. The participant
/// has to be created again, in a new process image, because Fast DDS never gives a participant id
/// (and with it the port) twice to one process.

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "abbe/dds/interface_address.hpp"

namespace abbe::dds {

/// One thread. Without rtnetlink(7), as where a sandbox forbids it, it sees nothing.
class InterfaceWatch {
 public:
  using Clock = std::chrono::steady_clock;
  /// An interface that comes up gets its addresses one after the other, and a cable bounces.
  static constexpr std::chrono::milliseconds kSettles{500};
  /// Interfaces that never rest, as containers that come and go, delay it no longer than that.
  static constexpr std::chrono::seconds kLongestWait{5};
  /// A participant lives for so long at least: interfaces that come and go must not keep abbe-dds
  /// from publishing.
  static constexpr std::chrono::seconds kShortestLife{5};

  /// Before the participant is created, so that no address comes in between unseen.
  explicit InterfaceWatch(Clock::time_point now);
  ~InterfaceWatch();
  InterfaceWatch(const InterfaceWatch&) = delete;
  InterfaceWatch& operator=(const InterfaceWatch&) = delete;

  /// An address that calls for another participant: running, of those that the profile allows
  /// (`allowed`; empty: all), and not known when the watch began nor since. Never waits.
  [[nodiscard]] std::optional<std::string> cycle(const std::vector<std::string>& allowed,
                                                 Clock::time_point now);

 private:
  int netlink_ = -1;
  Clock::time_point begun_;
  std::optional<Clock::time_point> first_change_,
      last_change_;                      ///< since the interfaces were last read
  std::vector<InterfaceAddress> known_;  ///< sorted
};

}  // namespace abbe::dds
