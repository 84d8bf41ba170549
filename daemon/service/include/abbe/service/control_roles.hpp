#pragma once
/// Permissions for requests on the control socket. Each role is given to the members of a Unix
/// group that [control] names; root and the user of the daemon have all roles. The roles Change and
/// Move each include Look; neither includes the other.

#include <string_view>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

enum class Role {
  Look,  ///< may read the state or stop a motion
  /// may change the active model or the zero of an axis, or start work that can lead to this
  Change,
  Move,  ///< may move a machine or a tracker, or keep it moving
};

/// Refused unless `peer` has the role; the error names the role, the group that has it, and the
/// remedy. Does not wait for a name service: see AccountNames. Any thread.
[[nodiscard]] Result<void> check_role(const ControlPeer& peer, Role role, std::string_view request,
                                      const ControlConfig& control);

}  // namespace abbe::daemon
