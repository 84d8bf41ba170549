#include "abbe/dds/announcer.hpp"

#include <fastdds/rtps/participant/ParticipantDiscoveryInfo.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>

#include <algorithm>

namespace abbe::dds {

namespace fast = eprosima::fastdds::dds;
using DiscoveryInfo = eprosima::fastrtps::rtps::ParticipantDiscoveryInfo;

Announcer::Announcer(Participant& participant, Writers& writers)
    : participant_(participant), writers_(writers) {
  participant_.get().set_listener(this, fast::StatusMask::none());
}

Announcer::~Announcer() {
  participant_.get().set_listener(nullptr, fast::StatusMask::none());
}

void Announcer::on_participant_discovery(fast::DomainParticipant* /*participant*/,
                                         DiscoveryInfo&& info) {
  // release: pairs with the acquire in cycle()
  if (info.status == DiscoveryInfo::DISCOVERED_PARTICIPANT)
    discovered_.store(true, std::memory_order_release);
}

void Announcer::cycle(WallTime now) {
  // acquire: pairs with the release in on_participant_discovery()
  if (discovered_.exchange(false, std::memory_order_acquire)) {
    interval_ = kFirst;
    next_round_ = std::min(next_round_, now + kFirst);
  }

  if (next_writer_ == 0 && now < next_round_) return;
  if (writers_.announced() == 0) return;
  writers_.announce(next_writer_);
  next_writer_ = (next_writer_ + 1) % writers_.announced();
  if (next_writer_ != 0) return;

  next_round_ = now + interval_;
  interval_ = std::min(2 * interval_, kPeriod);
}

}  // namespace abbe::dds
