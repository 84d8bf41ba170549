#include "abbe/dds/participant_addresses.hpp"

#include <fastdds/rtps/participant/ParticipantDiscoveryInfo.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>

#include <algorithm>

namespace abbe::dds {
namespace {

namespace fast = eprosima::fastdds::dds;
using DiscoveryInfo = eprosima::fastrtps::rtps::ParticipantDiscoveryInfo;

std::string addresses_in(const DiscoveryInfo& info) {
  using eprosima::fastrtps::rtps::IPLocator;
  std::string text;
  for (const auto& locator : info.info.default_locators.unicast) {
    const std::string address = IPLocator::ip_to_string(locator);
    if (text.find(address) == std::string::npos) text += (text.empty() ? "" : ", ") + address;
  }
  return text;
}

}  // namespace

ParticipantAddresses::ParticipantAddresses(Participant& participant) : participant_(participant) {
  participant_.get().set_listener(this, fast::StatusMask::none());
}

ParticipantAddresses::~ParticipantAddresses() {
  participant_.get().set_listener(nullptr, fast::StatusMask::none());
}

std::string ParticipantAddresses::of(const ParticipantId& id) const {
  const std::lock_guard lock(mutex_);
  const auto found = addresses_.find(id);
  return found == addresses_.end() ? std::string{} : found->second;
}

void ParticipantAddresses::on_participant_discovery(fast::DomainParticipant* /*participant*/,
                                                    DiscoveryInfo&& info) {
  ParticipantId id{};
  std::copy_n(std::begin(info.info.m_guid.guidPrefix.value), id.size(), id.begin());
  const std::lock_guard lock(mutex_);
  if (info.status == DiscoveryInfo::DISCOVERED_PARTICIPANT ||
      info.status == DiscoveryInfo::CHANGED_QOS_PARTICIPANT) {
    addresses_[id] = addresses_in(info);
  } else {
    addresses_.erase(id);
  }
}

}  // namespace abbe::dds
