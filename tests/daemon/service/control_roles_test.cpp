#include "abbe/service/control_roles.hpp"

#include <gmock/gmock.h>
#include <grp.h>
#include <unistd.h>

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr gid_t kNobodysGroup = 4'000'000'000;

/// Of the groups every Debian has two that differ.
gid_t gid_of_group(const char* name) {
  const group* found = ::getgrnam(name);
  return found != nullptr ? found->gr_gid : kNobodysGroup;
}

ControlPeer anna(std::vector<gid_t> groups) {
  return {.user = "anna", .uid = ::geteuid() + 1, .groups = std::move(groups)};
}

const ControlConfig kControl{.look_group = "", .change_group = "dialout", .move_group = "plugdev"};

std::string refused(const ControlPeer& peer, Role role, const ControlConfig& control = kControl) {
  const auto may = check_role(peer, role, "touch", control);
  return may ? "" : may.error().text;
}

TEST(ControlRoles, AreAssignedByGroup) {
  const auto changes = anna({kNobodysGroup, gid_of_group("dialout")});
  EXPECT_EQ(refused(changes, Role::Look), "");
  EXPECT_EQ(refused(changes, Role::Change), "");
  EXPECT_NE(refused(changes, Role::Move), "");
  const auto moves = anna({gid_of_group("plugdev")});
  EXPECT_NE(refused(moves, Role::Change), "");
  EXPECT_EQ(refused(moves, Role::Move), "");
}

TEST(ControlRoles, ARefusalNamesRoleUserGroupAndRemedy) {
  EXPECT_EQ(refused(anna({}), Role::Move),
            "touch: moves a machine or tracker, which anna may not: this requires the group "
            "\"plugdev\" ([control] "
            "move_group): gpasswd -a anna plugdev, then log in again");
  EXPECT_THAT(refused(anna({}), Role::Change, {.change_group = "abbe-none", .move_group = ""}),
              AllOf(HasSubstr("changes models or calibrates"), HasSubstr("\"abbe-none\""),
                    HasSubstr("does not exist on this computer")));
  EXPECT_THAT(refused(anna({}), Role::Move, {.move_group = ""}), HasSubstr("names no group"));
}

TEST(ControlRoles, ALookGroupExcludesUsersWithoutARole) {
  const ControlConfig control{
      .look_group = "audio", .change_group = "dialout", .move_group = "plugdev"};
  EXPECT_NE(refused(anna({kNobodysGroup}), Role::Look, control), "");
  for (const char* group : {"audio", "dialout", "plugdev"})
    EXPECT_EQ(refused(anna({gid_of_group(group)}), Role::Look, control), "") << group;
}

TEST(ControlRoles, RootAndTheDaemonsOwnUserHaveAll) {
  const ControlConfig nobody{.look_group = "abbe-none", .change_group = "", .move_group = ""};
  for (const Role role : {Role::Look, Role::Change, Role::Move}) {
    EXPECT_EQ(refused({.user = "root", .uid = 0}, role, nobody), "");
    EXPECT_EQ(refused({.user = "abbe", .uid = ::geteuid()}, role, nobody), "");
    EXPECT_NE(refused({}, role, nobody), "");
  }
}

}  // namespace
}  // namespace abbe::daemon
