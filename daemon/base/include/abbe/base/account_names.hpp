#pragma once
/// Looks up names of users and ids of groups without ever waiting for a name service (LDAP, a
/// domain controller), because a name service that hangs would block every request of the control
/// socket. The local files /etc/passwd and /etc/group are read first. A separate thread asks the
/// name service about the names and ids that these files do not contain; until it answers, the name
/// is not known. Answers are kept and refreshed after a while.

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace abbe::daemon {

/// These functions call getpwuid_r(3) and getgrnam_r(3) and may block. nullopt: there is no such
/// user or group.
[[nodiscard]] std::optional<std::string> user_from_name_service(uid_t uid);
[[nodiscard]] std::optional<gid_t> group_from_name_service(const std::string& name);

/// A user and its primary group. Reads /etc/passwd, then asks the name service, which may block:
/// call it only at the start of a program.
struct Account {
  uid_t uid = 0;
  gid_t gid = 0;
};
[[nodiscard]] std::optional<Account> account_of(const std::string& user);

struct AccountNamesOptions {
  std::filesystem::path users = "/etc/passwd", groups = "/etc/group";
  std::function<std::optional<std::string>(uid_t)> user_service = &user_from_name_service;
  std::function<std::optional<gid_t>(const std::string&)> group_service = &group_from_name_service;
  /// An answer is used for this time before the name service is asked again. This also holds for
  /// the answer that an account does not exist. While it is asked again, the previous answer
  /// applies.
  std::chrono::milliseconds fresh{10'000};
  /// look-up threads at a time; while this many hang, nothing further is asked
  std::size_t most_look_ups = 4;
  /// number of users whose answers are kept; the answers for others are forgotten
  std::size_t most_users = 1000;
};

/// All functions may be called from any thread.
class AccountNames {
 public:
  explicit AccountNames(AccountNamesOptions options = {});
  ~AccountNames();  ///< does not wait for a look-up
  AccountNames(const AccountNames&) = delete;
  AccountNames& operator=(const AccountNames&) = delete;

  /// The user name, for example "anna"; "uid 1004" while the name is not known.
  [[nodiscard]] std::string user(uid_t uid);
  /// The id of the group. nullopt: there is no such group, or it is not known yet.
  [[nodiscard]] std::optional<gid_t> group(const std::string& name);
  /// Begins to look up these groups and waits for the answers, at most `at_most` in total. Empty
  /// names are skipped.
  void look_up(std::span<const std::string> groups, std::chrono::milliseconds at_most);

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;  // shared with the threads of look-ups
};

/// The only instance of the process, for the accounts of this computer.
[[nodiscard]] AccountNames& account_names();

}  // namespace abbe::daemon
