#pragma once
/// [notify] of abbed.toml: webhooks and mails of abbe-notify. Not a member of Config, because abbed
/// only checks this table and does not use it.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// What is reported.
enum class NotifyKind : std::uint8_t {
  CalibrationAccepted,
  CalibrationRefused,
  PersonNeeded,  ///< READY, the next touch, a machine that waits for its release
  StartMissed,
  DeviceLost,     ///< not connected, or it reports what is wrong
  Drift,          ///< the model is DRIFT
  ModelNotValid,  ///< the model is STALE, INVALID, or gone: compensation stops
  StorageFailed,  ///< recorder or model store
  NotReachable,   ///< abbed does not answer, or it restarted
};

/// The words of `events`, in the order of NotifyKind.
inline constexpr std::array<std::string_view, 9> kNotifyKindNames{
    "calibration_accepted", "calibration_refused", "person_needed",
    "start_missed",         "device_lost",         "drift",
    "model_not_valid",      "storage_failed",      "not_reachable"};
[[nodiscard]] constexpr std::string_view name_of(NotifyKind kind) noexcept {
  return kNotifyKindNames[static_cast<std::size_t>(kind)];
}

struct NotifyWebhook {
  std::string url;                 ///< http or https; empty: it is in url_file
  std::filesystem::path url_file;  ///< one line, for receivers whose URL is a secret
  std::string header = "Authorization";
  std::filesystem::path token_file;  ///< one line, the value of `header`; empty: no header
};

struct NotifyMail {
  std::string server;    ///< "smtps://HOST:PORT" or "smtp://HOST:PORT"; empty: no mail
  bool starttls = true;  ///< for smtp://: required of the server
  std::string from;
  std::vector<std::string> to;
  std::string user;                     ///< empty: no login
  std::filesystem::path password_file;  ///< one line
};

struct NotifyConfig {
  std::vector<NotifyKind> events;  ///< default: all
  /// abbed that has just started connects to its devices: what is wrong during this time is not
  /// reported. Also the time without an answer after which abbed is not reachable.
  std::chrono::nanoseconds settle = std::chrono::seconds{10};
  /// Certificates (PEM) that are trusted besides those of the computer; empty: none.
  std::filesystem::path ca_file;
  std::vector<NotifyWebhook> webhooks;
  NotifyMail mail;
  NotifyConfig();
};

struct NotifySettings {
  std::filesystem::path control_socket = "/run/abbe/control.sock";
  std::string machine;  ///< [machine] name
  NotifyConfig notify;
};

/// Reads and checks the whole abbed.toml, as load_config() does, and that the files that [notify]
/// names exist and are not readable by others. Any thread.
[[nodiscard]] Result<NotifySettings> load_notify_settings(const std::filesystem::path& file);

/// Why `url` cannot be used for a webhook; empty: it can. `with_token`: a token is sent there.
[[nodiscard]] std::string webhook_url_fault(std::string_view url, bool with_token);

/// "https://hooks.example.com": without path, which may be a secret.
[[nodiscard]] std::string scheme_and_host(std::string_view url);

}  // namespace abbe::daemon
