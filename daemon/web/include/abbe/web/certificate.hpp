#pragma once
/// The TLS certificate of the page.

#include <chrono>
#include <filesystem>
#include <string>

#include "abbe/base/error.hpp"

namespace abbe::web {

/// In seconds: a certificate may be valid until the year 9999, which nanoseconds cannot express.
struct CertificateDates {
  std::chrono::sys_seconds from, until;
};

/// "2026-11-01"
[[nodiscard]] std::string day_of(std::chrono::sys_seconds time);

/// The dates of the first certificate of a PEM file. Io or BadInput with the name of the file.
[[nodiscard]] daemon::Result<CertificateDates> read_certificate(const std::filesystem::path& file);

/// BadInput if the certificate has expired or is not yet valid: "certificate web.crt expired on
/// 2026-11-01: replace it and restart abbe-web".
[[nodiscard]] daemon::Result<void> check_certificate(const std::filesystem::path& file,
                                                     std::chrono::system_clock::time_point now);

/// From 14 days before its end: "certificate web.crt expires on 2026-11-01: replace it and restart
/// abbe-web", then "expired". Empty before that.
inline constexpr std::chrono::days kCertificateNotice{14};
[[nodiscard]] std::string certificate_notice(const std::filesystem::path& file,
                                             std::chrono::sys_seconds until,
                                             std::chrono::system_clock::time_point now);

}  // namespace abbe::web
