#pragma once
/// The part of abbed that belongs to DDS: the socket to which abbe-dds connects, the publisher and,
/// if abbed starts abbe-dds itself, the supervisor. If [dds] supervise = "off", none of them
/// exists.

#include <sys/types.h>

#include <chrono>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/publishing/dds_supervisor.hpp"
#include "abbe/publishing/publisher.hpp"
#include "abbe/service/state_observer.hpp"

namespace abbe::daemon {

struct AbbedOptions;

class DdsSide {
 public:
  using WallTime = std::chrono::steady_clock::time_point;

  /// Opens the socket and starts abbe-dds. Io for errors of the system; other faults are added to
  /// `warnings`. `machine_id`: identity of the machine, empty: unknown. `utc`: offset for messages.
  [[nodiscard]] Result<void> open(const Config& config, const AbbedOptions& options,
                                  const std::string& machine_id, protocol::UtcOffset utc,
                                  std::vector<std::string>& warnings);
  /// The publisher; null: nothing is published. For the hub's thread.
  [[nodiscard]] Publisher* publisher() noexcept { return publisher_ ? &*publisher_ : nullptr; }
  /// The user of abbe-dds, if it is not the user of abbed.
  [[nodiscard]] std::optional<uid_t> network_user() const noexcept { return network_user_; }

  /// Restarts abbe-dds if it has ended. Call it every cycle, from the thread that called open().
  void cycle(WallTime now);
  /// State of abbe-dds after the last cycle(); nullopt: abbe-dds is not a child of abbed. Any
  /// thread.
  [[nodiscard]] std::optional<ObservedParticipant> participant() const;

 private:
  [[nodiscard]] Result<DdsLinkPeer> peer(const DdsConfig& config);
  void check_security(const DdsConfig& config, std::vector<std::string>& warnings) const;

  DdsProcess process_;
  std::optional<uid_t> network_user_;
  std::optional<Publisher> publisher_;
  std::optional<DdsSupervisor> supervisor_;
  mutable std::mutex mutex_;
  std::optional<ObservedParticipant> participant_;  // guarded by mutex_
};

}  // namespace abbe::daemon
