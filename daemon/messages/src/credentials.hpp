#pragma once
/// Keys, certificates and signed documents, by OpenSSL. Texts are PEM or S/MIME.

#include <chrono>
#include <memory>
#include <string>
#include <string_view>

#include <openssl/evp.h>
#include <openssl/x509.h>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

struct FreeOpenSsl {
  void operator()(EVP_PKEY* key) const noexcept { EVP_PKEY_free(key); }
  void operator()(X509* certificate) const noexcept { X509_free(certificate); }
};

/// A key pair (EC P-256) and its certificate.
struct Credentials {
  std::unique_ptr<EVP_PKEY, FreeOpenSsl> key;
  std::unique_ptr<X509, FreeOpenSsl> certificate;

  [[nodiscard]] std::string key_pem() const;
  [[nodiscard]] std::string certificate_pem() const;
};

struct ValidityPeriod {
  std::chrono::system_clock::time_point begin;
  std::chrono::system_clock::time_point end;
};

/// Makes a key and a certificate signed by `issuer`. If `issuer` is null, the certificate is
/// self-signed and is a certificate authority. Error Io if OpenSSL fails.
[[nodiscard]] Result<Credentials> make_credentials(const std::string& common_name,
                                                   ValidityPeriod period,
                                                   const Credentials* issuer);

/// S/MIME with the text in clear, as DDS Security requires for governance and permissions. Error Io
/// if OpenSSL fails.
[[nodiscard]] Result<std::string> sign_document(std::string_view text, const Credentials& signer);

/// Validity of the first certificate in a PEM text. Error BadInput if there is none.
[[nodiscard]] Result<ValidityPeriod> validity_of(std::string_view certificate_pem);

}  // namespace abbe::daemon
