#include "abbe/methods/touch_intake.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace abbe::daemon {

using protocol::HostTime;
using protocol::Snapshot;

bool TouchIntake::is_of_run(const Snapshot& snapshot) noexcept {
  if (!snapshot.has_trigger || snapshot.head.time < from_) return false;
  last_touch_ = snapshot.head.time;
  return true;
}

std::string TouchIntake::lost_zero(const Snapshot& touch) const {
  if (!rules_.zero_is_lost_by_restart || !has(touch.head.flags, protocol::SampleFlag::Restarted))
    return {};
  return fmt::format(
      "{} touch {}: its device restarted, and the axes have another zero; calibrate again",
      rules_.device, touch.trigger.touch);
}

std::string TouchIntake::refuse(const Snapshot& touch, std::string_view fault,
                                std::string_view expected) {
  note(touch, fmt::format("not used: {}; expected: {}", fault, expected));
  if (++refused_in_a_row_ < rules_.most_refused) return {};
  return fmt::format("{} successive touches could not be used; the last one: {}", refused_in_a_row_,
                     fault);
}

void TouchIntake::usable(const Snapshot& touch) noexcept {
  refused_in_a_row_ = 0;
  const HostTime at = touch.head.time;
  observed_ = observed_ ? std::array{std::min((*observed_)[0], at), std::max((*observed_)[1], at)}
                        : std::array{at, at};
}

std::string TouchIntake::pause(HostTime now) const {
  if (now - last_touch_ <= rules_.longest_pause) return {};
  return fmt::format("no touch for {:.0f} s",
                     std::chrono::duration<double>(now - last_touch_).count());
}

void TouchIntake::note(const Snapshot& touch, std::string_view what) {
  notes_.push_back(fmt::format("{} touch {}: {}", rules_.device, touch.trigger.touch, what));
}

std::vector<std::string> TouchIntake::take_notes() {
  return std::exchange(notes_, {});
}

}  // namespace abbe::daemon
