#include "abbe/drivers/can/pending_sync.hpp"

namespace abbe::drivers {

using protocol::HostTime;

namespace {

std::size_t node_of(const can::CanFrame& frame) {
  return frame.id & can::kMaxNodeId;
}

}  // namespace

void PendingSync::sent(HostTime at) {
  sent_ = at;
  substituted_ = Substituted::NotYet;
}

void PendingSync::forget() {
  sent_.reset();
  answers_until_ = {};
  answered_.reset();
}

bool PendingSync::waits(HostTime now) const {
  const bool may_leave = sent_ && substituted_ != Substituted::OnAnswer && now < *sent_ + kPatience;
  return may_leave || now < answers_until_;
}

HostTime PendingSync::deadline() const {
  return pending() ? *sent_ + answer_within_ : HostTime::max();
}

std::size_t PendingSync::settle(std::span<const ReceivedFrame> came, std::span<ReceivedFrame> out,
                                HostTime now, bool all_read) {
  std::size_t n = 0;
  for (const auto& received : came) {
    if (received.echo) {
      if (const auto sync = settle_echo(received)) out[n++] = *sync;
      continue;
    }
    if (proves_transmission(received)) out[n++] = substitute(Substituted::OnAnswer);
    if (can::cob::is_tpdo(received.frame)) answered_.set(node_of(received.frame));
    out[n++] = received;
  }
  if (all_read && now >= deadline()) out[n++] = substitute(Substituted::OnDeadline);
  return n;
}

/// The frame for the receiver; nullopt if the receiver must not see this echo.
std::optional<ReceivedFrame> PendingSync::settle_echo(const ReceivedFrame& echo) {
  if (!sent_ || echo.time + stamp_slack(period_) < *sent_) return std::nullopt;  // earlier SYNC
  std::optional<ReceivedFrame> sync;
  if (substituted_ == Substituted::NotYet) sync = echo.time_widened ? as_sent() : echo;
  // The SYNC was transmitted after its cycle: its answers must not mix with those of the next SYNC.
  if (substituted_ == Substituted::OnDeadline) answers_until_ = echo.time + period_;
  sent_.reset();
  answered_.reset();
  return sync;
}

/// The node has already answered the previous SYNC, so this answer belongs to the pending one.
bool PendingSync::proves_transmission(const ReceivedFrame& received) const {
  return pending() && can::cob::is_tpdo(received.frame) && received.time >= *sent_ &&
         answered_.test(node_of(received.frame));
}

ReceivedFrame PendingSync::substitute(Substituted why) {
  substituted_ = why;
  answered_.reset();
  return as_sent();
}

/// The SYNC as an echo with the time of send().
ReceivedFrame PendingSync::as_sent() const {
  return {.frame = can::encode_sync(), .time = *sent_, .time_widened = true, .echo = true};
}

}  // namespace abbe::drivers
