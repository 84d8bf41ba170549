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
  Look,    ///< reads state, or stops a motion
  Change,  ///< changes the active model or the zero of an axis, or may lead to such a change
  Move,    ///< moves a machine or a tracker, or keeps it moving
};

/// Refused unless `peer` has the role; the error names the role, the group that has it, and what to
/// do. Does not wait for a name service: see AccountNames. Any thread.
[[nodiscard]] Result<void> check_role(const ControlPeer& peer, Role role, std::string_view request,
                                      const ControlConfig& control);

}  // namespace abbe::daemon
