#pragma once
/// DDS Security with keys made by abbe: `abbe dds keys` creates a folder of keys; `[dds] security`
/// and the option `--security` of the subscribers give its path. Without DDS Security any
/// participant of the domain can publish as this machine. Not for real-time threads.
///
///   DIR/ca.key               key of the certificate authority, mode 0600: store it elsewhere
///   DIR/daemon/              identity of abbe-dds: may publish all topics of abbe
///   DIR/subscriber-1/ ...    identity of one subscriber: may read all topics of abbe
/// Each identity is complete and can be copied to another computer on its own:
///   identity_ca.crt, permissions_ca.crt, governance.p7s, identity.crt, permissions.p7s,
///   identity.key (mode 0600)

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Text of the warning that DDS Security is off: the consequences and the remedy. Shown in the log,
/// in `abbe status` and in Health.
[[nodiscard]] std::string dds_security_is_off(std::uint32_t domain);

/// The participant profile that abbe's programs use from the XML file of the site.
inline constexpr const char* kDdsProfileName = "abbe";

/// True if `security` is not empty, or if the profile kDdsProfileName in the XML file `profile` has
/// the dds.sec properties for the authentication and access control plugins. False for a file that
/// is not XML.
[[nodiscard]] bool dds_is_secured(const std::filesystem::path& security,
                                  const std::filesystem::path& profile);

struct DdsKeysOptions {
  std::filesystem::path folder;  ///< must not exist, or be empty
  int subscribers = 1;           ///< subscriber-1 to subscriber-N
  std::chrono::days validity{3650};
};

/// Creates the folder of keys: keys on the curve EC P-256, with governance and permissions
/// documents signed by a new certificate authority. Error Refused if the folder is not empty. Error
/// Io if it cannot be written or OpenSSL fails; the folder is then removed.
[[nodiscard]] Result<void> make_dds_keys(const DdsKeysOptions& options,
                                         std::chrono::system_clock::time_point now);

enum class DdsRole { Daemon, Subscriber };

/// The folder of one identity; all its files exist.
struct DdsIdentity {
  std::filesystem::path folder;
};

/// Finds and checks an identity. `folder` is the folder of one identity, or a folder made by
/// make_dds_keys(), in which `role` decides between daemon/ and subscriber-1/. Error BadInput, with
/// what to do, if a file is missing or unreadable, the key is readable by others, or the
/// certificate is not valid at `now`.
[[nodiscard]] Result<DdsIdentity> find_dds_identity(const std::filesystem::path& folder,
                                                    DdsRole role,
                                                    std::chrono::system_clock::time_point now);

/// The security properties of a participant: names as in Fast DDS, and values.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> dds_security_properties(
    const DdsIdentity& identity);

}  // namespace abbe::daemon
