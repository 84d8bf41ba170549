#pragma once
/// Who may ask what on the control socket. Roles are given by Unix groups that [control] names;
/// root and the daemon's own user have all of them. Who may change or move may look, too; neither
/// includes the other.

#include <string_view>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

enum class Role {
  Look,    ///< changes nothing, or stops a movement
  Change,  ///< changes what is in force, or may end in that
  Move,    ///< moves a machine or a tracker, or keeps it moving
};

/// Refused, naming role, group and what to do, unless `peer` has the role. Reads the group
/// database. Any thread.
[[nodiscard]] Result<void> check_role(const ControlPeer& peer, Role role, std::string_view request,
                                      const ControlConfig& control);

}  // namespace abbe::daemon
