#pragma once
/// Governance and permissions of abbe's domain [DDS-SECURITY 1.1, 9.4.1.2 and 9.4.1.3]. Pure.

#include <string>

#include "abbe/messages/dds_security.hpp"
#include "credentials.hpp"

namespace abbe::daemon {

/// The governance document. A participant needs an identity to join the domain. Discovery,
/// liveliness and whole submessages are encrypted, and every message is signed. Submessages are
/// encrypted instead of payloads because Fast DDS 2.9 and Cyclone DDS 0.10 are interoperable only
/// in this setting.
[[nodiscard]] std::string governance_document();

/// The permissions document of one identity. The daemon may publish abbe's topics, a subscriber may
/// read them. Everything else is denied.
[[nodiscard]] std::string permissions_document(const std::string& common_name, DdsRole role,
                                               ValidityPeriod period);

}  // namespace abbe::daemon
