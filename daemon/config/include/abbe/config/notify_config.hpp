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

/// The kinds of events that are reported.
enum class NotifyKind : std::uint8_t {
  CalibrationAccepted,
  CalibrationRefused,
  /// somebody must act: READY, the next touch, or a machine that waits for its release
  PersonNeeded,
  StartMissed,
  DeviceLost,     ///< a device is not connected or reports a fault
  Drift,          ///< the state of the model is DRIFT
  ModelNotValid,  ///< the model is STALE, INVALID or no longer there: compensation stops
  StorageFailed,  ///< the recorder or the model store failed
  NotReachable,   ///< abbed does not answer, or it restarted
};

/// The words of the key `events`, in the order of NotifyKind.
inline constexpr std::array<std::string_view, 9> kNotifyKindNames{
    "calibration_accepted", "calibration_refused", "person_needed",
    "start_missed",         "device_lost",         "drift",
    "model_not_valid",      "storage_failed",      "not_reachable"};
[[nodiscard]] constexpr std::string_view name_of(NotifyKind kind) noexcept {
  return kNotifyKindNames[static_cast<std::size_t>(kind)];
}

struct NotifyWebhook {
  std::string url;                 ///< http or https; empty: url_file contains the URL
  std::filesystem::path url_file;  ///< file with one line, for receivers whose URL is a secret
  std::string header = "Authorization";
  /// file with one line, the value of `header`; empty: no header
  std::filesystem::path token_file;
};

struct NotifyMail {
  std::string server;    ///< "smtps://HOST:PORT" or "smtp://HOST:PORT"; empty: no mail
  bool starttls = true;  ///< for smtp://: true if the server must offer STARTTLS
  std::string from;
  std::vector<std::string> to;
  std::string user;                     ///< empty: no login
  std::filesystem::path password_file;  ///< file with one line
};

struct NotifyConfig {
  std::vector<NotifyKind> events;  ///< kinds of events that are reported; default: all
  /// A fault is not reported during this time after the start of abbed, while abbed connects to its
  /// devices. abbed is reported as not reachable if it does not answer for this time.
  std::chrono::nanoseconds settle = std::chrono::seconds{10};
  /// File of certificates (PEM) that are trusted in addition to those of the computer; empty: none.
  std::filesystem::path ca_file;
  std::vector<NotifyWebhook> webhooks;
  NotifyMail mail;
  NotifyConfig();
};

struct NotifySettings {
  std::filesystem::path control_socket = "/run/abbe/control.sock";
  std::string machine;  ///< value of [machine] name
  NotifyConfig notify;
};

/// Reads and checks the whole abbed.toml as load_config() does and returns [notify]. Also checks
/// that the files that [notify] names exist and are not readable by others. Any thread.
[[nodiscard]] Result<NotifySettings> load_notify_settings(const std::filesystem::path& file);

/// The reason why `url` cannot be used for a webhook; empty if it can be used. `with_token`: the
/// request contains a secret token.
[[nodiscard]] std::string webhook_url_fault(std::string_view url, bool with_token);

/// Scheme and host of the URL: "https://hooks.example.com". The path is left out because it may be
/// a secret.
[[nodiscard]] std::string scheme_and_host(std::string_view url);

}  // namespace abbe::daemon
