#include "abbe/web/certificate.hpp"

#include <fmt/format.h>
#include <openssl/bio.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <ctime>
#include <memory>
#include <optional>
#include <string>

#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;
using std::chrono::sys_seconds;

struct Free {
  void operator()(BIO* bio) const { BIO_free(bio); }
  void operator()(X509* certificate) const { X509_free(certificate); }
};

/// UTCTime, and GeneralizedTime for dates from 2050 on (RFC 5280, 4.1.2.5).
std::optional<sys_seconds> time_of(const ASN1_TIME* time) {
  std::tm parts{};
  if (ASN1_TIME_to_tm(time, &parts) != 1) return std::nullopt;
  return sys_seconds{std::chrono::seconds{::timegm(&parts)}};
}

}  // namespace

std::string day_of(sys_seconds time) {
  const std::chrono::year_month_day day{std::chrono::floor<std::chrono::days>(time)};
  return fmt::format("{:04}-{:02}-{:02}", static_cast<int>(day.year()),
                     static_cast<unsigned>(day.month()), static_cast<unsigned>(day.day()));
}

Result<CertificateDates> read_certificate(const std::filesystem::path& file) {
  const auto text = daemon::read_regular_file(file);
  if (!text)
    return daemon::fail(ErrorCode::BadInput,
                        fmt::format("certificate: {} ([web] certificate)", text.error().text));
  const std::unique_ptr<BIO, Free> bio{
      BIO_new_mem_buf(text->data(), static_cast<int>(text->size()))};
  const std::unique_ptr<X509, Free> certificate{
      PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr)};
  if (!certificate)
    return daemon::fail(ErrorCode::BadInput,
                        fmt::format("certificate {}: not a certificate in PEM form ([web] "
                                    "certificate)",
                                    file.string()));
  const auto from = time_of(X509_get0_notBefore(certificate.get()));
  const auto until = time_of(X509_get0_notAfter(certificate.get()));
  if (!from || !until)
    return daemon::fail(ErrorCode::BadInput,
                        fmt::format("certificate {}: its dates cannot be read", file.string()));
  return CertificateDates{.from = *from, .until = *until};
}

Result<void> check_certificate(const std::filesystem::path& file,
                               std::chrono::system_clock::time_point when) {
  const auto now = std::chrono::floor<std::chrono::seconds>(when);
  const auto dates = read_certificate(file);
  ABBE_TRY(dates);
  if (now >= dates->until)
    return daemon::fail(ErrorCode::BadInput,
                        fmt::format("certificate {} expired on {}: replace it and restart abbe-web",
                                    file.string(), day_of(dates->until)));
  if (now < dates->from)
    return daemon::fail(ErrorCode::BadInput,
                        fmt::format("certificate {} is valid from {} on: check the clock of this "
                                    "computer",
                                    file.string(), day_of(dates->from)));
  return {};
}

std::string certificate_notice(const std::filesystem::path& file, sys_seconds until,
                               std::chrono::system_clock::time_point now) {
  const auto left = until - std::chrono::floor<std::chrono::seconds>(now);
  if (left > kCertificateNotice) return {};
  return fmt::format("certificate {} {} on {}: replace it and restart abbe-web", file.string(),
                     left.count() <= 0 ? "expired" : "expires", day_of(until));
}

}  // namespace abbe::web
