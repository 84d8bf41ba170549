#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <array>

#include "abbe/base/text_file.hpp"
#include "abbe/messages/dds_security.hpp"
#include "abbe/result/try.hpp"
#include "credentials.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

constexpr const char* kKey = "identity.key";
constexpr const char* kCertificate = "identity.crt";
constexpr std::array kFiles{kKey,
                            kCertificate,
                            "identity_ca.crt",
                            "permissions_ca.crt",
                            "governance.p7s",
                            "permissions.p7s"};

fs::path identity_in(const fs::path& folder, DdsRole role) {
  std::error_code error;
  if (fs::exists(folder / kCertificate, error)) return folder;
  const fs::path own = folder / (role == DdsRole::Daemon ? "daemon" : "subscriber-1");
  return fs::exists(own / kCertificate, error) ? own : folder;
}

/// An Error if all users can read the private key: it then does not prove an identity. ssh also
/// refuses such keys.
Result<void> check_key_mode(const fs::path& key) {
  struct stat file {};
  if (::stat(key.c_str(), &file) != 0 || (file.st_mode & S_IROTH) == 0) return {};
  return fail(
      ErrorCode::BadInput,
      fmt::format(
          "{}: every user of this computer can read this key: set its mode to 600 (chmod 600), or "
          "make new keys with `abbe dds keys` if another user may have copied it",
          key.string()));
}

Result<void> check_validity(const fs::path& certificate, const std::string& pem,
                            std::chrono::system_clock::time_point now) {
  const auto period = validity_of(pem);
  if (!period)
    return fail(ErrorCode::BadInput,
                fmt::format("{}: {}", certificate.string(), period.error().text));
  if (now >= period->begin && now <= period->end) return {};
  const auto day = [](auto t) { return fmt::gmtime(std::chrono::system_clock::to_time_t(t)); };
  return fail(
      ErrorCode::BadInput,
      fmt::format(
          "{}: valid from {:%Y-%m-%d} to {:%Y-%m-%d}, but today is {:%Y-%m-%d}: set the clock, or "
          "make new keys with `abbe dds keys`",
          certificate.string(), day(period->begin), day(period->end), day(now)));
}

}  // namespace

std::string dds_security_is_off(std::uint32_t domain) {
  return fmt::format(
      "DDS Security is off: anyone on domain {} can publish as this machine; to switch it on, make "
      "keys with `abbe dds keys` and enter their folder in [dds] security",
      domain);
}

Result<DdsIdentity> find_dds_identity(const fs::path& folder, DdsRole role,
                                      std::chrono::system_clock::time_point now) {
  const fs::path identity = fs::absolute(identity_in(folder, role));
  for (const char* name : kFiles) {
    const auto text = read_text(identity / name);
    if (!text)
      return fail(ErrorCode::BadInput,
                  fmt::format("DDS Security: {}: check that the folder was made by "
                              "`abbe dds keys` and that this user may read it",
                              text.error().text));
    if (name != kCertificate) continue;
    ABBE_TRY(check_validity(identity / name, *text, now));
  }

  ABBE_TRY(check_key_mode(identity / kKey));
  return DdsIdentity{identity};
}

std::vector<std::pair<std::string, std::string>> dds_security_properties(
    const DdsIdentity& identity) {
  const auto file = [&identity](const char* name) {
    return "file://" + (identity.folder / name).string();
  };

  const std::string auth = "dds.sec.auth.builtin.PKI-DH.";
  const std::string access = "dds.sec.access.builtin.Access-Permissions.";
  return {{"dds.sec.auth.plugin", "builtin.PKI-DH"},
          {auth + "identity_ca", file("identity_ca.crt")},
          {auth + "identity_certificate", file(kCertificate)},
          {auth + "private_key", file(kKey)},
          {"dds.sec.access.plugin", "builtin.Access-Permissions"},
          {access + "permissions_ca", file("permissions_ca.crt")},
          {access + "governance", file("governance.p7s")},
          {access + "permissions", file("permissions.p7s")},
          {"dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC"}};
}

}  // namespace abbe::daemon
