#pragma once
/// abbed's end of the local socket to abbe-dds. abbed listens and abbe-dds connects, so that
/// abbe-dds can be restarted at any time.
///
/// - No call blocks. While the socket is full, the newest sample per key waits; older live samples
///   are dropped and counted.
/// - After each new connection all durable samples are sent again.
/// - Beats are frames without content that prove that abbed runs. A beat is sent only when no
///   durable sample waits.
/// - One thread uses the link: the thread that assembles snapshots. If it hangs, the beats stop.
/// - Not for real-time threads: makes system calls and allocates.
/// - The caller must publish ModelState at least once a second: its age changes, and abbe-dds
///   discards the state when abbed was silent, so that a stale ACTIVE is never republished.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/account_names.hpp"
#include "abbe/base/error.hpp"
#include "abbe/messages/cdr.hpp"
#include "abbe/messages/dds_process.hpp"
#include "abbe/messages/topics.hpp"

namespace abbe::daemon {

struct DdsLinkCounters {
  std::uint64_t sent = 0;  ///< frames handed to the kernel completely, beats included
  /// live samples dropped: not connected, or replaced by a newer one while waiting
  std::uint64_t dropped_live = 0;
  std::uint64_t refused = 0;      ///< payloads that are too long or not CDR of their topic
  std::uint64_t connections = 0;  ///< accepted connections of abbe-dds
  std::uint64_t foreign_connections =
      0;  ///< connections of other processes or users, closed at once
};

/// The process that may connect; the kernel reports its identity (SO_PEERCRED). With supervision
/// this is the supervised abbe-dds, without supervision any process of `user`.
struct DdsLinkPeer {
  /// The supervised process; null without supervision. Must outlive the link, which records in it
  /// the times of beats and answers.
  DdsProcess* process = nullptr;
  /// The user as which systemd runs abbe-dds; its group may open the socket. nullopt: the user of
  /// abbed.
  std::optional<Account> user = {};
};

class DdsLink {
 public:
  /// CLOCK_MONOTONIC, even with simulated devices, because abbe-dds compares the times of the beats
  /// with this clock.
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds kBeatPeriod{100};

  /// Creates the socket file (mode 0660, of the group of `peer.user`) and listens. Error Refused if
  /// the group cannot be set. A socket file without a listener is
  /// replaced. Error Io if another process listens there or the folder is missing; Error Usage if
  /// the path is longer than a socket address allows (107 bytes).
  [[nodiscard]] static Result<DdsLink> listen(const std::filesystem::path& socket,
                                              DdsLinkPeer peer = {});
  ~DdsLink();  ///< closes the connection (abbe-dds then publishes INVALID), removes the file
  DdsLink(DdsLink&&) noexcept;
  DdsLink& operator=(DdsLink&&) noexcept;

  /// Sends one payload that encode() has made. The key of the instance is read from the payload.
  /// `at`: the time to which the age in a live sample refers; abbe-dds adds the delay since then.
  void publish(Topic topic, std::span<const std::byte> payload,
               WallTime at = WallTime::clock::now());

  /// Sends a beat, at most one per kBeatPeriod. Call every cycle.
  void beat(WallTime now);

  /// Accepts connections of abbe-dds (a new one replaces the old one), closes connections of other
  /// processes, reads the answers to the beats, detects that abbe-dds disconnected, and sends
  /// waiting samples. Call every cycle.
  void poll();

  [[nodiscard]] bool connected() const noexcept;
  /// True if connected and no beat has been unanswered for longer than kUnanswered. False: abbe-dds
  /// hangs or is not connected.
  [[nodiscard]] bool answers() const noexcept;
  static constexpr std::chrono::seconds kUnanswered{1};
  /// Another publisher in the domain that claims to be this machine, as abbe-dds sees it; empty:
  /// there is none.
  [[nodiscard]] const std::string& twin() const noexcept;
  /// One of the literals "connected", "does not answer", "waiting" (not connected).
  [[nodiscard]] const char* state() const noexcept;
  [[nodiscard]] const DdsLinkCounters& counters() const noexcept;
  /// null: abbed does not supervise abbe-dds.
  [[nodiscard]] const DdsProcess* process() const noexcept;

 private:
  struct State;
  explicit DdsLink(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
