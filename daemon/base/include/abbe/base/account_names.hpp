#pragma once
/// Names of users and ids of groups, without ever waiting for a name service (LDAP, a domain
/// controller): one that hangs would hang every request of the control socket. The local files
/// /etc/passwd and /etc/group are read first. What they do not contain is asked from the name
/// service on a thread of its own; until it answers, the name is not known. Answers are kept, and
/// asked again after a while.

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace abbe::daemon {

/// getpwuid_r(3) and getgrnam_r(3): may block. nullopt: there is no such user or group.
[[nodiscard]] std::optional<std::string> user_from_name_service(uid_t uid);
[[nodiscard]] std::optional<gid_t> group_from_name_service(const std::string& name);

/// A user and its primary group. Reads /etc/passwd, then asks the name service, which may block:
/// for the start of a program.
struct Account {
  uid_t uid = 0;
  gid_t gid = 0;
};
[[nodiscard]] std::optional<Account> account_of(const std::string& user);

struct AccountNamesOptions {
  std::filesystem::path users = "/etc/passwd", groups = "/etc/group";
  std::function<std::optional<std::string>(uid_t)> user_service = &user_from_name_service;
  std::function<std::optional<gid_t>(const std::string&)> group_service = &group_from_name_service;
  /// An answer, also that there is no such account, is used for this time without asking again;
  /// while it is asked again, the previous answer applies.
  std::chrono::milliseconds fresh{10'000};
  std::size_t most_look_ups = 4;  ///< threads; while this many hang, nothing further is asked
  std::size_t most_users = 1000;  ///< kept; the others are forgotten
};

/// Any thread.
class AccountNames {
 public:
  explicit AccountNames(AccountNamesOptions options = {});
  ~AccountNames();  ///< does not wait for a look-up
  AccountNames(const AccountNames&) = delete;
  AccountNames& operator=(const AccountNames&) = delete;

  /// "anna"; "uid 1004" while the name is not known.
  [[nodiscard]] std::string user(uid_t uid);
  /// nullopt: there is no such group, or it is not known yet.
  [[nodiscard]] std::optional<gid_t> group(const std::string& name);
  /// Begins to look up these groups and waits for the answers, at most `at_most` in total. Empty
  /// names are skipped.
  void look_up(std::span<const std::string> groups, std::chrono::milliseconds at_most);

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;  // also owned by the threads of look-ups
};

/// The names of this computer, for the whole process.
[[nodiscard]] AccountNames& account_names();

}  // namespace abbe::daemon
