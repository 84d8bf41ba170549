#pragma once
/// DDS Security with abbe's own keys: `abbe dds keys` makes a folder, `[dds] security` and the
/// subscribers' `--security` name it. Without it anyone on the domain can publish as this machine.
/// Ordinary world.
///
///   DIR/ca.key               key of the certificate authority, 0600: keep it away from the machine
///   DIR/daemon/              identity of abbe-dds: may publish every topic of abbe
///   DIR/subscriber-1/ ...    identity of one subscriber: may read every topic of abbe
/// Each identity is complete, and can be copied to another computer by itself:
///   identity_ca.crt, permissions_ca.crt, governance.p7s, identity.crt, identity.key (0600), permissions.p7s

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// What it means that there are no keys, and what to do; for the log, `abbe status` and Health.
[[nodiscard]] std::string dds_security_is_off(std::uint32_t domain);

/// The participant profile that abbe's programs use, whatever else a site's file holds.
inline constexpr const char* kDdsProfileName = "abbe";

/// Keys are named, or that profile in the file of the site has dds.sec properties of its own:
/// plugins for authentication and access. A file that is no XML is not.
[[nodiscard]] bool dds_is_secured(const std::filesystem::path& security,
                                  const std::filesystem::path& profile);

struct DdsKeysOptions {
  std::filesystem::path folder;  ///< must not exist, or be empty
  int subscribers = 1;           ///< subscriber-1 to subscriber-N
  std::chrono::days validity{3650};
};

/// Makes the folder above: EC P-256, governance and permissions signed by a new certificate
/// authority. Error: Refused if the folder has anything in it, Io if it cannot be written or
/// OpenSSL fails; then nothing stays.
[[nodiscard]] Result<void> make_dds_keys(const DdsKeysOptions& options,
                                         std::chrono::system_clock::time_point now);

enum class DdsRole { Daemon, Subscriber };

/// The files of one identity; all of them are there.
struct DdsIdentity {
  std::filesystem::path folder;
};

/// `folder` is an identity, or what make_dds_keys() made: then daemon/ or subscriber-1/ in it.
/// Error BadInput with what to do: a file is missing or cannot be read, the key is readable by
/// everybody, or the certificate is not valid at `now`.
[[nodiscard]] Result<DdsIdentity> find_dds_identity(const std::filesystem::path& folder,
                                                    DdsRole role,
                                                    std::chrono::system_clock::time_point now);

/// The properties of a participant, by the names Fast DDS gives them.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> dds_security_properties(
    const DdsIdentity& identity);

}  // namespace abbe::daemon
