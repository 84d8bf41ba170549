#include "abbe/notify/event_limit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <utility>

namespace abbe::notify {

void EventLimit::add(const Event& event) {
  if (std::ranges::find(wanted_, event.kind) == wanted_.end()) return;
  Held& held = held_[event.kind];
  ++held.changes;
  std::erase_if(held.events, [&event](const Event& e) { return e.subject == event.subject; });
  if (held.events.size() >= kMostHeld) held.events.erase(held.events.begin());
  held.events.push_back(event);
}

std::vector<Notification> EventLimit::due(std::chrono::steady_clock::time_point now) {
  std::vector<Notification> out;
  for (auto& [kind, held] : held_) {
    if (held.events.empty() || (held.sent && now - *held.sent < kPeriod)) continue;
    out.push_back(notification_of(held));
    held = {.sent = now, .events = {}, .changes = 0};
  }
  return out;
}

Notification EventLimit::notification_of(const Held& held) {
  const Event& latest = held.events.back();
  Notification out{.id = fmt::format("{}.{}", run_, ++sent_),
                   .machine = machine_,
                   .kind = std::string{daemon::name_of(latest.kind)},
                   .phase = latest.phase,
                   .severity = latest.severity,
                   .model_id = latest.model_id,
                   .session = latest.session,
                   .changes = held.changes,
                   .simulated = latest.simulated,
                   .time = latest.time};
  for (const Event& event : held.events) {
    out.text += (out.text.empty() ? "" : "; ") + event.text;
    out.subjects.push_back(event.subject);
    // If a notification contains both a lost device and one that has returned, it has the phase of
    // the lost one.
    if (event.severity > out.severity || out.phase == Phase::Ends) out.phase = event.phase;
    out.severity = std::max(out.severity, event.severity);
  }
  return out;
}

std::string random_run() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

Notification test_notification(const std::string& machine, protocol::UtcTime now) {
  return {.id = random_run() + ".test",
          .machine = machine,
          .kind = "test",
          .text = "test of abbe-notify: no change of state",
          .time = now};
}

}  // namespace abbe::notify
