#include "credentials.hpp"

#include <openssl/asn1.h>
#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>

#include <array>
#include <ctime>
#include <utility>

namespace abbe::daemon {
namespace {

using SystemTime = std::chrono::system_clock::time_point;

struct FreeMore {
  void operator()(BIO* bio) const noexcept { BIO_free(bio); }
  void operator()(PKCS7* document) const noexcept { PKCS7_free(document); }
  void operator()(X509_EXTENSION* extension) const noexcept { X509_EXTENSION_free(extension); }
};
using Bio = std::unique_ptr<BIO, FreeMore>;

tl::unexpected<Error> openssl_failed(const char* what) {
  std::array<char, 256> text{};
  ERR_error_string_n(ERR_get_error(), text.data(), text.size());
  return fail(ErrorCode::Io, std::string(what) + ": OpenSSL: " + text.data());
}

Bio reader_of(std::string_view text) {
  return Bio{BIO_new_mem_buf(text.data(), static_cast<int>(text.size()))};
}

Bio memory() {
  return Bio{BIO_new(BIO_s_mem())};
}

std::string bio_text(const Bio& bio) {
  char* begin = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &begin);
  return size > 0 ? std::string(begin, static_cast<std::size_t>(size)) : std::string{};
}

bool add_extension(X509* certificate, X509* issuer, int which, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const std::unique_ptr<X509_EXTENSION, FreeMore> extension{
      X509V3_EXT_conf_nid(nullptr, &context, which, value)};
  return extension && X509_add_ext(certificate, extension.get(), -1) == 1;
}

bool set_random_serial(X509* certificate) {
  std::uint64_t serial = 0;
  if (RAND_bytes(reinterpret_cast<unsigned char*>(&serial), sizeof serial) != 1) return false;
  return ASN1_INTEGER_set_uint64(X509_get_serialNumber(certificate), serial >> 1) == 1;
}

bool set_times(X509* certificate, ValidityPeriod period) {
  const auto set = [](ASN1_TIME* out, SystemTime t) {
    return ASN1_TIME_set(out, std::chrono::system_clock::to_time_t(t)) != nullptr;
  };
  return set(X509_getm_notBefore(certificate), period.begin) &&
         set(X509_getm_notAfter(certificate), period.end);
}

bool set_subject(X509* certificate, const std::string& common_name) {
  return X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate), "CN", MBSTRING_UTF8,
                                    reinterpret_cast<const unsigned char*>(common_name.c_str()), -1,
                                    -1, 0) == 1;
}

/// Sets the permitted uses of a key. The authority signs certificates (keyCertSign) and documents
/// (digitalSignature).
bool set_uses(X509* certificate, X509* issuer, bool is_authority) {
  return add_extension(certificate, issuer, NID_basic_constraints,
                       is_authority ? "critical,CA:TRUE" : "critical,CA:FALSE") &&
         add_extension(certificate, issuer, NID_key_usage,
                       is_authority ? "critical,keyCertSign,cRLSign,digitalSignature"
                                    : "critical,digitalSignature,keyAgreement") &&
         add_extension(certificate, issuer, NID_subject_key_identifier, "hash");
}

}  // namespace

std::string Credentials::key_pem() const {
  const Bio out = memory();
  PEM_write_bio_PrivateKey(out.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr);
  return bio_text(out);
}

std::string Credentials::certificate_pem() const {
  const Bio out = memory();
  PEM_write_bio_X509(out.get(), certificate.get());
  return bio_text(out);
}

Result<Credentials> make_credentials(const std::string& common_name, ValidityPeriod period,
                                     const Credentials* issuer) {
  Credentials made{decltype(Credentials::key){EVP_EC_gen("P-256")},
                   decltype(Credentials::certificate){X509_new()}};
  if (!made.key || !made.certificate) return openssl_failed("make a key");
  X509* const certificate = made.certificate.get();
  X509* const by = issuer != nullptr ? issuer->certificate.get() : certificate;
  EVP_PKEY* const signing_key = issuer != nullptr ? issuer->key.get() : made.key.get();

  constexpr long kVersion3 = 2;
  const bool signed_now = X509_set_version(certificate, kVersion3) == 1 &&
                          set_random_serial(certificate) && set_times(certificate, period) &&
                          set_subject(certificate, common_name) &&
                          X509_set_issuer_name(certificate, X509_get_subject_name(by)) == 1 &&
                          X509_set_pubkey(certificate, made.key.get()) == 1 &&
                          set_uses(certificate, by, issuer == nullptr) &&
                          X509_sign(certificate, signing_key, EVP_sha256()) > 0;
  if (!signed_now) return openssl_failed("make a certificate");
  return made;
}

Result<std::string> sign_document(std::string_view text, const Credentials& signer) {
  const Bio in = reader_of(text);
  const Bio out = memory();
  constexpr int kFlags = PKCS7_DETACHED | PKCS7_TEXT;
  const std::unique_ptr<PKCS7, FreeMore> document{
      PKCS7_sign(signer.certificate.get(), signer.key.get(), nullptr, in.get(), kFlags)};
  if (!document || BIO_reset(in.get()) != 1 ||
      SMIME_write_PKCS7(out.get(), document.get(), in.get(), kFlags) != 1)
    return openssl_failed("sign a document");
  return bio_text(out);
}

Result<ValidityPeriod> validity_of(std::string_view certificate_pem) {
  const Bio in = reader_of(certificate_pem);
  const std::unique_ptr<X509, FreeOpenSsl> certificate{
      PEM_read_bio_X509(in.get(), nullptr, nullptr, nullptr)};
  std::tm begin{};
  std::tm end{};
  if (!certificate || ASN1_TIME_to_tm(X509_get0_notBefore(certificate.get()), &begin) != 1 ||
      ASN1_TIME_to_tm(X509_get0_notAfter(certificate.get()), &end) != 1) {
    ERR_clear_error();
    return fail(ErrorCode::BadInput, "not a certificate");
  }
  return ValidityPeriod{std::chrono::system_clock::from_time_t(::timegm(&begin)),
                        std::chrono::system_clock::from_time_t(::timegm(&end))};
}

}  // namespace abbe::daemon
