#include "abbe/web/certificate.hpp"

#include <fmt/format.h>
#include <openssl/bio.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <ctime>
#include <memory>
#include <string>

#include "abbe/base/text_file.hpp"
#include "abbe/base/utc_text.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;
using SystemTime = std::chrono::system_clock::time_point;

struct Free {
  void operator()(BIO* bio) const { BIO_free(bio); }
  void operator()(X509* certificate) const { X509_free(certificate); }
};

SystemTime time_of(const ASN1_TIME* time) {
  std::tm parts{};
  if (ASN1_TIME_to_tm(time, &parts) != 1) return {};
  return std::chrono::system_clock::from_time_t(::timegm(&parts));
}

/// "2026-11-01": the day is what a person needs.
std::string day_of(SystemTime time) {
  constexpr std::size_t kDay = 10;
  return daemon::to_text(std::chrono::time_point_cast<std::chrono::nanoseconds>(time))
      .substr(0, kDay);
}

}  // namespace

Result<CertificateDates> read_certificate(const std::filesystem::path& file) {
  const auto text = daemon::read_regular_file(file);
  if (!text) return tl::unexpected(text.error());
  const std::unique_ptr<BIO, Free> bio{
      BIO_new_mem_buf(text->data(), static_cast<int>(text->size()))};
  const std::unique_ptr<X509, Free> certificate{
      PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr)};
  if (!certificate)
    return daemon::fail(ErrorCode::BadInput,
                        fmt::format("certificate {}: not a certificate in PEM form ([web] "
                                    "certificate)",
                                    file.string()));
  return CertificateDates{.from = time_of(X509_get0_notBefore(certificate.get())),
                          .until = time_of(X509_get0_notAfter(certificate.get()))};
}

Result<void> check_certificate(const std::filesystem::path& file, SystemTime now) {
  const auto dates = read_certificate(file);
  if (!dates) return tl::unexpected(dates.error());
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

}  // namespace abbe::web
