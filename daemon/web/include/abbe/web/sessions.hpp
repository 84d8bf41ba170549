#pragma once
/// Who is logged in, in memory only: a restart of abbe-web ends all sessions. Thread-safe.

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/web/password_turns.hpp"
#include "abbe/web/web_users.hpp"

namespace abbe::web {

struct WebSession {
  std::string token;  ///< in the cookie
  std::string csrf;   ///< in the header X-CSRF-Token of every change
  std::string user;
  WebRole role = WebRole::View;
};

/// Whether a look at the session counts as its use, which delays its end.
enum class SessionUse { Request, Look };

struct SessionLimits {
  std::chrono::seconds idle = std::chrono::minutes{30};  ///< without a request
  std::chrono::seconds total = std::chrono::hours{12};
  std::size_t sessions = 64;    ///< at this limit the session that was idle longest ends
  std::size_t of_one_user = 8;  ///< at this limit the oldest session of the user ends
  std::size_t failures = 5;     ///< wrong passwords of one address within `pause`
  std::chrono::seconds pause = std::chrono::minutes{1};
};

class Sessions {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kPatience{10};
  /// The error of log_in() after a check.
  static constexpr std::string_view kWrong = "wrong name or password";
  /// `report` receives a line for each fault in the file of users; any thread.
  explicit Sessions(
      const std::filesystem::path& users_file, SessionLimits limits = {},
      std::function<void(const std::string&)> report = [](const std::string&) {});

  /// Refused for a wrong name or password, after too many failures of `address`, and if no file of
  /// users is configured; as UsersFile::users() if the file cannot be used. Waits for its turn in
  /// PasswordTurns; Io after kPatience.
  [[nodiscard]] daemon::Result<WebSession> log_in(const std::string& user,
                                                  const std::string& password,
                                                  const std::string& address,
                                                  Clock::time_point now);
  /// The session of a cookie, as long as its user has the same role and password in the file of
  /// users.
  [[nodiscard]] std::optional<WebSession> find(const std::string& token, Clock::time_point now,
                                               SessionUse use = SessionUse::Request);
  void log_out(const std::string& token);
  [[nodiscard]] bool possible() const noexcept { return users_.has_value(); }

 private:
  struct Kept {
    WebSession session;
    std::string hash;  ///< of the password, as it was at the log-in
    Clock::time_point begun, used;
  };
  struct Failures {
    std::size_t count = 0;
    Clock::time_point last;
  };
  /// Refused if they are too many.
  [[nodiscard]] daemon::Result<std::size_t> failures_of(const std::string& address,
                                                        Clock::time_point now);
  void remove_ended(Clock::time_point now);
  void make_place_for(const std::string& user);

  std::optional<UsersFile> users_;
  SessionLimits limits_;
  PasswordTurns turns_;
  std::mutex mutex_;  // of the members below
  std::map<std::string, Kept> kept_;
  std::map<std::string, Failures> failures_;
};

}  // namespace abbe::web
