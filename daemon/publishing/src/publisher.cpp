#include "abbe/publishing/publisher.hpp"

#include <fmt/format.h>

#include <utility>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;

constexpr auto kStatePeriod = 1s;  // the IDL guarantees this period

std::chrono::nanoseconds period(double rate_hz) {
  return rate_hz > 0.0 ? std::chrono::nanoseconds{static_cast<std::int64_t>(1e9 / rate_hz)} : 0ns;
}

}  // namespace

/// True if a sample must be sent now. The next sample is due one period after the time at which
/// this one was sent, not one period after the time at which it was due.
bool Publisher::due(Pace& pace, const protocol::Snapshot& view, WallTime now, double rate_hz) {
  const bool axis_lost = (view.missing_mask & ~pace.missing_mask) != 0;
  if (now < pace.next && !axis_lost) return false;
  pace = {now + period(rate_hz), view.missing_mask};
  return true;
}

Publisher::Publisher(DdsLink link, PublisherOptions options, protocol::UtcOffset utc)
    : link_(std::move(link)), options_(std::move(options)), utc_(utc) {}

template <class T>
void Publisher::send(Topic topic, const T& message, WallTime at) {
  // encode() fails if a value exceeds the bounds of the IDL; the configuration alone cannot cause
  // this. The payload is then empty, and the link counts it as refused.
  if (auto encoded = encode(message, payload_); !encoded) {
    refusal_ = fmt::format("{} not sent: {}", traits(topic).name, encoded.error().text);
  }
  link_.publish(topic, payload_, at);
}

void Publisher::send_encoded(Topic topic, std::span<const std::byte> payload) {
  payload_.assign(payload.begin(), payload.end());
  (void)set_sequence_number(topic, payload_, ++sequence_number_);
  link_.publish(topic, payload_);
}

void Publisher::beat(WallTime wall) {
  link_.poll();
  link_.beat(wall);
}

void Publisher::snapshot(const protocol::Snapshot& view, protocol::HostTime now, WallTime wall) {
  if (due(snapshots_, view, wall, options_.snapshot_hz))
    send(Topic::Snapshot, snapshot_message(view, utc_, stamp(now)), wall);
}

void Publisher::compensation(const protocol::Snapshot& view, const ActiveModelState& active,
                             protocol::HostTime now, WallTime wall) {
  if (view.axis_count < 3 || !due(compensations_, view, wall, options_.compensation_hz)) return;
  send(Topic::Compensation,
       compensation_message(active.status, active.model, view, options_.tool_offset_m,
                            options_.validity, stamp(now)),
       wall);
}

void Publisher::model(const ActiveModelState& active, protocol::HostTime now, WallTime wall) {
  if (active.publication != nullptr && active.revision != sent_revision_) {
    send_encoded(Topic::ErrorModel, active.publication->model);
    for (const auto& slice : active.publication->slices) send_encoded(Topic::ErrorGrid, slice);
    sent_revision_ = active.revision;
    next_state_ = wall;
  }

  options_.identity.twin_seen = link_.twin();
  const bool changed = active.status != sent_status_ || active.reason != sent_reason_ ||
                       options_.identity != sent_identity_;
  if (!changed && wall < next_state_) return;
  send(Topic::Identity, identity_message(options_.identity, active.model, stamp(now)));
  send(Topic::ModelState,
       state_message(active.status, active.reason, active.model, options_.validity, stamp(now)));
  sent_status_ = active.status;
  sent_reason_ = active.reason;
  sent_identity_ = options_.identity;
  next_state_ = wall + kStatePeriod;
}

void Publisher::health(std::span<const StreamHealth> streams, protocol::HostTime now) {
  for (const StreamHealth& s : streams) {
    send(Topic::Health,
         health_message(s.status, s.rate_hz, s.latency_p50_s, s.latency_p99_s, stamp(now)));
  }
}

void Publisher::event(const SessionEvent& event) {
  send(Topic::CalibrationEvent, event_message(event, options_.machine));
}

}  // namespace abbe::daemon
