#pragma once
/// The users who may log in to the page. A file with one line for each:
///
///     NAME:ROLE:HASH        anna:calibrate:$y$j9T$...
///
/// ROLE: view, calibrate or administer; each includes the ones before. HASH: crypt(5), as
/// `abbe-web --hash-password` makes it. Lines that begin with # and empty lines are ignored. The
/// file must not be readable by other users. No user is predefined.

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::web {

enum class WebRole : std::uint8_t { View, Calibrate, Administer };
[[nodiscard]] std::string_view name(WebRole role) noexcept;
[[nodiscard]] std::optional<WebRole> web_role_named(std::string_view name) noexcept;

struct WebUser {
  std::string name;
  WebRole role = WebRole::View;
  std::string hash;
};

/// Io if the file cannot be read; BadInput with all faulty lines in the details, or if others may
/// read the file.
[[nodiscard]] daemon::Result<std::vector<WebUser>> read_web_users(
    const std::filesystem::path& file);

/// The file, read again when it changes. While it has a fault, the users of the last good file
/// stay: a slip of the pen must not log out everybody. Thread-safe.
class UsersFile {
 public:
  using Users = std::shared_ptr<const std::vector<WebUser>>;
  /// `report` receives a line for each fault in the file, and when it is good again.
  UsersFile(std::filesystem::path file, std::function<void(const std::string&)> report)
      : file_(std::move(file)), report_(std::move(report)) {}

  /// The error of read_web_users() only if the file was never good.
  [[nodiscard]] daemon::Result<Users> users();

 private:
  void read();

  std::filesystem::path file_;
  std::function<void(const std::string&)> report_;
  std::mutex mutex_;  // of the members below
  Users good_;
  std::optional<daemon::Error> fault_;
  std::optional<std::array<std::int64_t, 4>> read_;  ///< inode, change time, size, mode
};

/// The user, if the password is right. Takes as long for an unknown name as for a wrong password.
[[nodiscard]] std::optional<WebUser> find_web_user(const std::vector<WebUser>& users,
                                                   const std::string& name,
                                                   const std::string& password);

inline constexpr std::size_t kShortestPassword = 10, kLongestPassword = 200;
/// A line for the file. Usage for a name with other characters than A-Z a-z 0-9 . _ -, and for a
/// password that is too short or too long.
[[nodiscard]] daemon::Result<std::string> web_user_line(const std::string& name, WebRole role,
                                                        const std::string& password);

}  // namespace abbe::web
