#include "abbe/drivers/can/sync_under_way.hpp"

namespace abbe::drivers {

using protocol::HostTime;

namespace {

std::size_t node_of(const can::CanFrame& frame) {
  return frame.id & can::kMaxNodeId;
}

}  // namespace

void SyncUnderWay::sent(HostTime at) {
  sent_ = at;
  counted_ = Counted::NotYet;
}

void SyncUnderWay::forget() {
  sent_.reset();
  answers_until_ = {};
  answered_.reset();
}

bool SyncUnderWay::waits(HostTime now) const {
  const bool may_leave = sent_ && counted_ != Counted::ByItsAnswer && now < *sent_ + kPatience;
  return may_leave || now < answers_until_;
}

HostTime SyncUnderWay::deadline() const {
  return unheard() ? *sent_ + answer_within_ : HostTime::max();
}

std::size_t SyncUnderWay::settle(std::span<const ReceivedFrame> came, std::span<ReceivedFrame> out,
                                 HostTime now, bool all_read) {
  std::size_t n = 0;
  for (const auto& received : came) {
    if (received.echo) {
      if (const auto sync = settle_echo(received)) out[n++] = *sync;
      continue;
    }
    if (proves_that_it_left(received)) out[n++] = count(Counted::ByItsAnswer);
    if (can::cob::is_tpdo(received.frame)) answered_.set(node_of(received.frame));
    out[n++] = received;
  }
  if (all_read && now >= deadline()) out[n++] = count(Counted::ByTheDeadline);
  return n;
}

/// What the receiver is to see of an echo.
std::optional<ReceivedFrame> SyncUnderWay::settle_echo(const ReceivedFrame& echo) {
  if (!sent_ || echo.time + stamp_slack(period_) < *sent_) return std::nullopt;  // of one before
  std::optional<ReceivedFrame> sync;
  if (counted_ == Counted::NotYet) sync = echo.time_widened ? as_sent() : echo;
  // Its cycle is over, and its answers come now: they must not meet the next one's.
  if (counted_ == Counted::ByTheDeadline) answers_until_ = echo.time + period_;
  sent_.reset();
  answered_.reset();
  return sync;
}

/// A node that has answered the SYNC before has no other one to answer.
bool SyncUnderWay::proves_that_it_left(const ReceivedFrame& received) const {
  return unheard() && can::cob::is_tpdo(received.frame) && received.time >= *sent_ &&
         answered_.test(node_of(received.frame));
}

ReceivedFrame SyncUnderWay::count(Counted how) {
  counted_ = how;
  answered_.reset();
  return as_sent();
}

/// As if it had left when it was handed over.
ReceivedFrame SyncUnderWay::as_sent() const {
  return {.frame = can::encode_sync(), .time = *sent_, .time_widened = true, .echo = true};
}

}  // namespace abbe::drivers
