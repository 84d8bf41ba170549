#include "abbe/drivers/can/sync_under_way.hpp"

#include "abbe/protocol/can/canopen.hpp"

namespace abbe::drivers {

using protocol::HostTime;

void SyncUnderWay::sent(HostTime at) {
  sent_ = at;
  counted_ = false;
}

bool SyncUnderWay::waits(HostTime now) const {
  return sent_ && now < *sent_ + kPatience;
}

HostTime SyncUnderWay::deadline() const {
  return unheard() ? *sent_ + answer_within_ : HostTime::max();
}

std::size_t SyncUnderWay::settle(std::span<const ReceivedFrame> came, std::span<ReceivedFrame> out,
                                 HostTime now) {
  std::size_t count = 0;
  for (const auto& received : came) {
    if (received.echo && !take_echo()) continue;
    const bool answer = can::cob::is_tpdo(received.frame) && unheard() && received.time >= *sent_;
    if (answer) out[count++] = count_from_sending();
    out[count++] = received;
  }
  if (now >= deadline()) out[count++] = count_from_sending();
  return count;
}

/// Whether it is one: the receiver has not seen this SYNC.
bool SyncUnderWay::take_echo() {
  const bool first = unheard();
  sent_.reset();
  return first;
}

ReceivedFrame SyncUnderWay::count_from_sending() {
  counted_ = true;
  return {.frame = can::encode_sync(), .time = *sent_, .echo = true};
}

}  // namespace abbe::drivers
