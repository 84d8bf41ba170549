#pragma once
/// [web] of abbed.toml: the page that abbe-web serves. Not a member of Config, because abbed only
/// checks this table and does not use it.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"

namespace abbe::daemon {

struct WebConfig {
  std::string address = "127.0.0.1";  ///< numeric IPv4 or IPv6 address to listen on
  std::uint16_t port = 8440;          ///< 0: any free port, which abbe-web prints
  /// PEM files for TLS; both or none. Required for an address that other computers can reach.
  std::filesystem::path certificate, key;
  /// Names of this computer in the address line of a browser, besides `address` and localhost. A
  /// request for another name is refused (DNS rebinding).
  std::vector<std::string> host_names;
  /// File written by `abbe-web --hash-password`; empty: nobody can log in.
  std::filesystem::path users;
  bool view_without_login = true;
  /// A session ends after this time without a request of its browser; the stream of events to the
  /// page does not count as a request.
  std::chrono::nanoseconds session_idle = std::chrono::minutes{30};
  double live_hz = 25.0;        ///< rate of the axis positions
  std::size_t most_pages = 16;  ///< most pages that receive events at the same time
  [[nodiscard]] bool tls() const noexcept { return !certificate.empty(); }
};

struct WebSettings {
  Config config;
  WebConfig web;
};

/// Reads and checks the whole abbed.toml as load_config() does and returns [web]. Any thread.
[[nodiscard]] Result<WebSettings> load_web_settings(const std::filesystem::path& file);

}  // namespace abbe::daemon
