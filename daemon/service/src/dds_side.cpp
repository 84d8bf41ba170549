#include "dds_side.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <utility>

#include "abbe/base/account_names.hpp"
#include "abbe/messages/dds_security.hpp"
#include "abbe/result/try.hpp"
#include "abbe/service/abbed.hpp"
#include "abbed_options.hpp"

namespace abbe::daemon {

Result<void> DdsSide::open(const Config& config, const AbbedOptions& options,
                           const std::string& machine_id, protocol::UtcOffset utc,
                           std::vector<std::string>& warnings) {
  if (config.dds.supervise == Supervise::Off) return {};
  if (options.dds_unit && config.dds.supervise == Supervise::Child)
    warnings.emplace_back(
        "[dds] supervise = \"child\": abbe-dds, which reads the network, runs with the rights of "
        "abbed; remove this line, and it runs as a user of its own");
  const auto connects = peer(config.dds);
  ABBE_TRY(connects);
  auto link = DdsLink::listen(config.dds.socket, *connects);
  ABBE_TRY(link);
  auto publishes = publisher_options(config);
  publishes.identity.machine_id = machine_id;
  publisher_.emplace(std::move(*link), std::move(publishes), utc);
  check_security(config.dds, warnings);
  if (config.dds.supervise != Supervise::Child) return {};
  auto started = DdsSupervisor::start(abbe_dds_options(config, options.dds_program, process_),
                                      WallTime::clock::now());
  ABBE_TRY(started);
  supervisor_.emplace(std::move(*started));

  return {};
}

/// The process that may connect to the socket for abbe-dds.
Result<DdsLinkPeer> DdsSide::peer(const DdsConfig& config) {
  if (config.supervise == Supervise::Child) return DdsLinkPeer{.process = &process_};
  if (config.user.empty()) return DdsLinkPeer{};
  const auto account = account_of(config.user);
  if (!account)
    return fail(ErrorCode::Io,
                fmt::format("[dds] user: there is no user \"{}\", as which systemd runs abbe-dds: "
                            "systemd-sysusers makes it",
                            config.user));
  if (account->uid != ::geteuid()) network_user_ = account->uid;
  return DdsLinkPeer{.user = account};
}

/// Adds warnings, but no errors: acquisition and recording do not need abbe-dds, and abbe-dds
/// itself refuses unusable keys.
void DdsSide::check_security(const DdsConfig& config, std::vector<std::string>& warnings) const {
  if (!dds_is_secured(config.security, config.profile)) {
    warnings.push_back(dds_security_is_off(config.domain));
  } else if (!config.security.empty() && !network_user_) {  // otherwise only abbe-dds can read the
                                                            // keys
    const auto keys =
        find_dds_identity(config.security, DdsRole::Daemon, std::chrono::system_clock::now());
    if (!keys)
      warnings.push_back(keys.error().text +
                         "; nothing is published over DDS until this is corrected");
  }
}

void DdsSide::cycle(WallTime now) {
  if (!supervisor_) return;
  supervisor_->poll(now);
  const std::lock_guard lock{mutex_};
  const auto& end = supervisor_->last_end();
  participant_ = {.restarts = supervisor_->restarts(),
                  .last_end = end ? end->text() : std::string{},
                  .start_fault = supervisor_->start_fault()};
}

std::optional<ObservedParticipant> DdsSide::participant() const {
  const std::lock_guard lock{mutex_};
  return participant_;
}

}  // namespace abbe::daemon
