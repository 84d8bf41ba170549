#pragma once
/// abbed's end of the local socket to abbe-dds. abbed listens, abbe-dds connects, so abbe-dds may
/// die and come back. Nothing here ever blocks: what the socket does not take at once waits, newest
/// per key, until it does; older live samples are dropped and counted, durable topics are all sent
/// again to every new abbe-dds. A beat says that nothing durable waits any more. Used by one
/// thread, the one that assembles snapshots, so that a hung abbed stops beating. The real-time
/// threads never come here: it makes system calls and allocates. ModelState is to be published at
/// least once a second: its age changes, and abbe-dds forgets it when abbed was silent, so that a
/// stale ACTIVE is never published again.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/messages/cdr.hpp"
#include "abbe/messages/dds_process.hpp"
#include "abbe/messages/topics.hpp"

namespace abbe::daemon {

struct DdsLinkCounters {
  std::uint64_t sent = 0;  ///< frames handed to the kernel completely, beats included
  std::uint64_t dropped_live =
      0;                      ///< live samples dropped: nobody connected, or a newer one came first
  std::uint64_t refused = 0;  ///< payloads that are no CDR payload of their topic or too long
  std::uint64_t connections = 0;  ///< how often an abbe-dds came
  std::uint64_t strangers = 0;    ///< connections of other processes or users, closed at once
};

/// Who may connect: the process that is supervised, else any process of the user abbed runs as.
struct DdsLinkPeer {
  DdsProcess* process = nullptr;  ///< outlives the link; also learns when it was asked and answered
};

class DdsLink {
 public:
  /// Wall time even with simulated devices: abbe-dds measures the beats with its own
  /// CLOCK_MONOTONIC.
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds kBeatPeriod{100};

  /// Creates the socket file (mode 0660) and listens. A file left by a dead abbed is replaced;
  /// Error (Io) if a living one answers there, the path is too long for a socket (107 bytes), or
  /// the directory is missing.
  [[nodiscard]] static Result<DdsLink> listen(const std::filesystem::path& socket,
                                              DdsLinkPeer peer = {});
  ~DdsLink();  ///< closes the connection (abbe-dds publishes INVALID) and removes the socket file
  DdsLink(DdsLink&&) noexcept;
  DdsLink& operator=(DdsLink&&) noexcept;

  /// Hands over one payload as encode() made it. The key is read from the payload. `at`: the
  /// instant the age in a live sample counts to; abbe-dds adds what the sample waits from then on.
  void publish(Topic topic, std::span<const std::byte> payload,
               WallTime at = WallTime::clock::now());

  /// Says "I am alive". Call it every turn of the loop; it sends at most every kBeatPeriod.
  void beat(WallTime now);

  /// Accepts an abbe-dds (a newer one replaces the older one), closes what others connect, takes
  /// the answers to the beats, notices that abbe-dds left, sends what waits. Call every cycle.
  void poll();

  [[nodiscard]] bool connected() const noexcept;
  /// Connected, and no beat is without an answer for longer than kUnanswered: else abbe-dds hangs.
  [[nodiscard]] bool answers() const noexcept;
  static constexpr std::chrono::seconds kUnanswered{1};
  /// A literal: "connected", "does not answer", "waiting".
  [[nodiscard]] const char* state() const noexcept;
  [[nodiscard]] const DdsLinkCounters& counters() const noexcept;
  [[nodiscard]] const DdsProcess* process() const noexcept;  ///< null: abbed does not supervise it

 private:
  struct State;
  explicit DdsLink(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
