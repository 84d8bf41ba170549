#include "documents.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

namespace abbe::daemon {
namespace {

// Cyclone DDS refuses a document with a domain above 230.
constexpr const char* kDomains =
    "<domains><id_range><min>0</min><max>230</max></id_range></domains>";

std::string xml_time(std::chrono::system_clock::time_point t) {
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}", fmt::gmtime(std::chrono::system_clock::to_time_t(t)));
}

}  // namespace

std::string governance_document() {
  return fmt::format(R"(<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="omg_shared_ca_governance.xsd">
  <domain_access_rules>
    <domain_rule>
      {}
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>SIGN</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
          <data_protection_kind>NONE</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
)",
                     kDomains);
}

std::string permissions_document(const std::string& common_name, DdsRole role,
                                 ValidityPeriod period) {
  const char* const may = role == DdsRole::Daemon ? "publish" : "subscribe";
  // The daemon also reads Identity, to detect other machines with its name.
  const char* const twins =
      role == DdsRole::Daemon
          ? "<subscribe><topics><topic>abbe/v1/Identity</topic></topics></subscribe>"
          : "";
  return fmt::format(R"(<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="omg_shared_ca_permissions.xsd">
  <permissions>
    <grant name="{0}">
      <subject_name>CN={0}</subject_name>
      <validity><not_before>{1}</not_before><not_after>{2}</not_after></validity>
      <allow_rule>
        {3}
        <{4}><topics><topic>abbe/v1/*</topic></topics></{4}>
        {5}
      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
)",
                     common_name, xml_time(period.begin), xml_time(period.end), kDomains, may,
                     twins);
}

}  // namespace abbe::daemon
