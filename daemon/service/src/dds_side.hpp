#pragma once
/// What abbed has of DDS: the socket to which abbe-dds connects, what is published over it, and,
/// where abbed starts abbe-dds itself, its supervisor. Nothing of it if [dds] supervise = "off".

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

  /// Opens the socket and starts abbe-dds. Io for what the system refuses; the rest is added to
  /// `warnings`. `machine_id`: identity of the machine, empty: unknown. `utc`: of messages.
  [[nodiscard]] Result<void> open(const Config& config, const AbbedOptions& options,
                                  const std::string& machine_id, protocol::UtcOffset utc,
                                  std::vector<std::string>& warnings);
  /// Null: nothing is published. For the hub's thread.
  [[nodiscard]] Publisher* publisher() noexcept { return publisher_ ? &*publisher_ : nullptr; }
  /// The user of abbe-dds, if it has a user of its own.
  [[nodiscard]] std::optional<uid_t> network_user() const noexcept { return network_user_; }

  /// Restarts abbe-dds when it ended. Call it every cycle, from the thread that called open().
  void cycle(WallTime now);
  /// As the last cycle() left it; nullopt: abbe-dds is no child of abbed. Any thread.
  [[nodiscard]] std::optional<ObservedParticipant> participant() const;

 private:
  [[nodiscard]] Result<DdsLinkPeer> peer(const DdsConfig& config);
  void check_security(const DdsConfig& config, std::vector<std::string>& warnings) const;

  DdsProcess process_;
  std::optional<uid_t> network_user_;
  std::optional<Publisher> publisher_;
  std::optional<DdsSupervisor> supervisor_;
  mutable std::mutex mutex_;
  std::optional<ObservedParticipant> participant_;  // under mutex_
};

}  // namespace abbe::daemon
