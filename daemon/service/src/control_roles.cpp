#include "abbe/service/control_roles.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <string>

#include "abbe/base/account_names.hpp"

namespace abbe::daemon {
namespace {

bool is_in(const ControlPeer& peer, const std::string& group) {
  const auto gid = group.empty() ? std::nullopt : account_names().group(group);
  return gid && std::ranges::find(peer.groups, *gid) != peer.groups.end();
}

bool has(const ControlPeer& peer, Role role, const ControlConfig& control) {
  if (peer.uid == 0 || peer.uid == ::geteuid()) return true;
  switch (role) {
    case Role::Look:
      return control.look_group.empty() || is_in(peer, control.look_group) ||
             is_in(peer, control.change_group) || is_in(peer, control.move_group);
    case Role::Change:
      return is_in(peer, control.change_group);
    case Role::Move:
      return is_in(peer, control.move_group);
  }
  return false;
}

struct RoleWords {
  std::string_view does, key;
  const std::string& group;
};

RoleWords words_of(Role role, const ControlConfig& control) {
  switch (role) {
    case Role::Look:
      return {"looks at the daemon", "look_group", control.look_group};
    case Role::Change:
      return {"changes models or calibrates", "change_group", control.change_group};
    case Role::Move:
      break;
  }
  return {"moves a machine or tracker", "move_group", control.move_group};
}

std::string remedy(const ControlPeer& peer, const RoleWords& words) {
  if (words.group.empty())
    return fmt::format("[control] {} names no group: only root and the daemon's own user may",
                       words.key);
  if (!account_names().group(words.group))
    return fmt::format(
        "the group \"{}\" ([control] {}) does not exist on this computer, or the name service has "
        "not "
        "answered yet: groupadd --system {}",
        words.group, words.key, words.group);
  return fmt::format(
      "this requires the group \"{}\" ([control] {}): gpasswd -a {} {}, then log in again",
      words.group, words.key, peer.user, words.group);
}

}  // namespace

Result<void> check_role(const ControlPeer& peer, Role role, std::string_view request,
                        const ControlConfig& control) {
  if (has(peer, role, control)) return {};
  const RoleWords words = words_of(role, control);
  return fail(ErrorCode::Refused, fmt::format("{}: {}, which {} may not: {}", request, words.does,
                                              peer.user, remedy(peer, words)));
}

}  // namespace abbe::daemon
