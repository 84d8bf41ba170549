#include "clock_watch.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <string>

#include "abbe/recording/recorded_clock.hpp"

namespace abbe::daemon {

void ClockWatch::cycle(Hub& hub) {
  const ClockChange change = clock_.since_start();
  const auto further = [](auto a, auto b) { return std::chrono::abs(a - b) >= kLeastClockChange; };
  if (!further(change.step, reported_.step) && !further(change.suspended, reported_.suspended))
    return;
  const auto attached = hub.call(
      [&hub, attachment = to_attachment(change)]() mutable {
        const HubParts& on = hub.parts();
        on.recorder->attach(std::move(attachment), on.time.now());
        return true;
      },
      Hub::kHangsAfter);
  if (!attached) return;  // the next cycle tries again
  reported_ = change;
  for (const std::string& text : in_words(change, "abbed started"))
    fmt::print(stderr, "abbed: {}\n", text);
}

}  // namespace abbe::daemon
