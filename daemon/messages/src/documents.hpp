#pragma once
/// Governance and permissions of abbe's domain [DDS-SECURITY 1.1, 9.4.1.2 and 9.4.1.3]. Pure.

#include <string>

#include "abbe/messages/dds_security.hpp"
#include "credentials.hpp"

namespace abbe::daemon {

/// Nobody joins without an identity; discovery, liveliness and whole submessages are encrypted,
/// every message is signed. Submessages and not payloads, because Fast DDS 2.9 and Cyclone DDS 0.10
/// agree on these only.
[[nodiscard]] std::string governance_document();

/// The daemon may publish abbe's topics, a subscriber may read them; nothing else.
[[nodiscard]] std::string permissions_document(const std::string& common_name, DdsRole role,
                                               ValidityPeriod period);

}  // namespace abbe::daemon
