#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "abbe/base/file_descriptor.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/messages/dds_security.hpp"
#include "abbe/result/try.hpp"
#include "credentials.hpp"
#include "documents.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

constexpr mode_t kOwnerOnly = 0600;
constexpr mode_t kWorldReadable = 0644;
/// New keys are valid from one day before they are made, so that a computer whose clock is slow
/// accepts them at once.
constexpr auto kClockTolerance = std::chrono::hours{24};

/// The participant whose subject has the smaller SHA-256 begins the handshake. If a Fast DDS 2.9
/// participant begins, it sends a Diffie-Hellman key in a format that Cyclone DDS 0.10 cannot read
/// (Fast-DDS issue 3802). The daemon uses Fast DDS, so its subject was chosen such that its hash is
/// above that of every subscriber: the hash begins with 18 one bits, the largest of the first
/// thousand subscribers with 11.
constexpr const char* kDaemonSubject = "abbe-daemon-336310";

Result<void> write_new(const fs::path& file, std::string_view text, mode_t mode) {
  const FileDescriptor fd{::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode)};
  const auto size = static_cast<ssize_t>(text.size());
  if (!fd || ::write(fd.get(), text.data(), text.size()) != size || ::fsync(fd.get()) != 0)
    return fail(ErrorCode::Io, fmt::format("write {}: {}", file.string(), std::strerror(errno)));
  return {};
}

Result<void> check_folder_is_empty(const fs::path& folder) {
  std::error_code error;
  if (!fs::exists(folder, error) || fs::is_empty(folder, error)) return {};
  return fail(ErrorCode::Refused,
              fmt::format("{}: the folder is not empty, nothing is overwritten: give a new folder "
                          "with -o, or remove this one",
                          folder.string()));
}

/// The data for all identities of one folder.
struct Issuer {
  fs::path folder;
  ValidityPeriod period;
  Credentials authority;
  std::string governance;  ///< the signed governance document
};

Result<void> make_identity(const Issuer& issuer, const std::string& name, DdsRole role) {
  const std::string common_name = role == DdsRole::Daemon ? kDaemonSubject : "abbe-" + name;
  auto identity = make_credentials(common_name, issuer.period, &issuer.authority);
  ABBE_TRY(identity);
  auto permissions =
      sign_document(permissions_document(common_name, role, issuer.period), issuer.authority);
  ABBE_TRY(permissions);

  const fs::path folder = issuer.folder / name;
  const std::string authority_pem = issuer.authority.certificate_pem();
  return create_folder(folder, NewFolder::OfTheCaller)
      .and_then([&] { return write_new(folder / "identity.key", identity->key_pem(), kOwnerOnly); })
      .and_then([&] {
        return write_new(folder / "identity.crt", identity->certificate_pem(), kWorldReadable);
      })
      .and_then(
          [&] { return write_new(folder / "identity_ca.crt", authority_pem, kWorldReadable); })
      .and_then(
          [&] { return write_new(folder / "permissions_ca.crt", authority_pem, kWorldReadable); })
      .and_then(
          [&] { return write_new(folder / "governance.p7s", issuer.governance, kWorldReadable); })
      .and_then(
          [&] { return write_new(folder / "permissions.p7s", *permissions, kWorldReadable); });
}

Result<Issuer> make_issuer(const DdsKeysOptions& options,
                           std::chrono::system_clock::time_point now) {
  const ValidityPeriod period{now - kClockTolerance, now + options.validity};
  auto authority =
      make_credentials(fmt::format("abbe DDS CA {:%Y-%m-%dT%H:%M:%SZ}",
                                   fmt::gmtime(std::chrono::system_clock::to_time_t(now))),
                       period, nullptr);
  ABBE_TRY(authority);
  auto governance = sign_document(governance_document(), *authority);
  ABBE_TRY(governance);
  return Issuer{options.folder, period, std::move(*authority), std::move(*governance)};
}

Result<void> make_all(const Issuer& issuer, int subscribers) {
  auto made =
      create_folder(issuer.folder, NewFolder::OfTheCaller)
          .and_then([&] {
            return write_new(issuer.folder / "ca.key", issuer.authority.key_pem(), kOwnerOnly);
          })
          .and_then([&] { return make_identity(issuer, "daemon", DdsRole::Daemon); });
  for (int i = 1; made && i <= subscribers; ++i)
    made = make_identity(issuer, fmt::format("subscriber-{}", i), DdsRole::Subscriber);
  return made;
}

}  // namespace

Result<void> make_dds_keys(const DdsKeysOptions& options,
                           std::chrono::system_clock::time_point now) {
  ABBE_TRY(check_folder_is_empty(options.folder));
  const auto issuer = make_issuer(options, now);
  ABBE_TRY(issuer);
  auto made = make_all(*issuer, options.subscribers);
  std::error_code ignored;
  if (!made) fs::remove_all(options.folder, ignored);
  return made;
}

}  // namespace abbe::daemon
