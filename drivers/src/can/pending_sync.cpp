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
  deadlines_.set(Due::Echo, at + answer_within_);
  deadlines_.set(Due::Transmission, at + kPatience);
}

void PendingSync::forget() {
  sent_.reset();
  deadlines_.cancel_all();
  answered_.reset();
}

bool PendingSync::waits(HostTime now) const {
  return deadlines_.ahead(Due::Transmission, now) || deadlines_.ahead(Due::Answers, now);
}

std::size_t PendingSync::settle(std::span<const ReceivedFrame> came, std::span<ReceivedFrame> out,
                                HostTime now, bool all_read) {
  std::size_t n = 0;
  for (const auto& received : came) {
    if (received.echo) {
      if (const auto sync = settle_echo(received)) out[n++] = *sync;
      continue;
    }
    if (proves_transmission(received)) {
      deadlines_.cancel(Due::Transmission);
      out[n++] = substitute();
    }
    if (can::cob::is_tpdo(received.frame)) answered_.set(node_of(received.frame));
    out[n++] = received;
  }
  if (all_read && now >= deadline()) out[n++] = substitute();
  return n;
}

/// Converts the echo to the frame for the receiver; nullopt if the receiver must not see the echo.
std::optional<ReceivedFrame> PendingSync::settle_echo(const ReceivedFrame& echo) {
  // the echo of an earlier SYNC
  if (!sent_ || echo.time + stamp_slack(period_) < *sent_) return std::nullopt;
  std::optional<ReceivedFrame> sync;
  if (pending()) {
    sync = echo.time_widened ? as_sent() : echo;
  } else if (deadlines_.is_set(Due::Transmission)) {
    // The SYNC was transmitted after the end of its cycle: the next SYNC waits, so that the answers
    // to this one do not mix with those to the next.
    deadlines_.set(Due::Answers, echo.time + period_);
  }

  sent_.reset();
  deadlines_.cancel(Due::Echo);
  deadlines_.cancel(Due::Transmission);
  answered_.reset();
  return sync;
}

/// True if the frame is an answer of a node that has already answered the previous SYNC: it belongs
/// to the pending SYNC, which therefore was transmitted.
bool PendingSync::proves_transmission(const ReceivedFrame& received) const {
  return pending() && can::cob::is_tpdo(received.frame) && received.time >= *sent_ &&
         answered_.test(node_of(received.frame));
}

ReceivedFrame PendingSync::substitute() {
  deadlines_.cancel(Due::Echo);
  answered_.reset();
  return as_sent();
}

/// The pending SYNC as an echo with the time of send(), marked as widened.
ReceivedFrame PendingSync::as_sent() const {
  return {.frame = can::encode_sync(), .time = *sent_, .time_widened = true, .echo = true};
}

}  // namespace abbe::drivers
