#include "abbe/daemon/touch_service.hpp"

#include <fmt/format.h>

#include <utility>

namespace abbe::daemon {

using protocol::TouchFlag;

Result<std::array<double, 3>> TouchService::where() const {
  if (!configured_)
    return fail(ErrorCode::Refused, "touch: there is no measuring machine, [cmm], in the configuration");
  return devices_.machine_position();
}

Result<void> TouchService::start(std::vector<TouchRequest> requests, std::vector<drivers::ProbePoint> leave) {
  const auto stands = where();
  if (!configured_) return tl::unexpected(stands.error());
  if (status_.running) return fail(ErrorCode::Refused, "touch: touches are under way already");
  if (requests.empty()) return fail(ErrorCode::Usage, "touch: no point to touch");
  if (!stands) return tl::unexpected(stands.error());
  status_ = {.running = true, .asked = requests.size(), .touches = {}, .reason = {}};
  waiting_.assign(std::make_move_iterator(requests.begin()), std::make_move_iterator(requests.end()));
  leave_ = std::move(leave);
  leaving_ = false;
  looked_.reset();
  ask_next();
  return {};
}

Result<void> TouchService::cancel() {
  if (!status_.running) return fail(ErrorCode::Refused, "touch: no touches are under way");
  give_up("cancelled");
  return {};
}

const TouchService::Status& TouchService::look() {
  looked_.reset();
  return status_;
}

void TouchService::give_up(std::string reason) {
  if (status_.reason.empty()) status_.reason = std::move(reason);
  waiting_.clear();
}

void TouchService::ask_next() {
  refused_ = false;
  if (waiting_.empty()) return leave();
  std::vector<drivers::ProbePoint> points = std::move(waiting_.front().way);
  points.push_back(waiting_.front().point);
  waiting_.pop_front();
  devices_.measure(points);
}

/// Only from where the last touch was to be: after any other the way out is not known.
void TouchService::leave() {
  leaving_ = status_.reason.empty() && !leave_.empty();
  status_.running = leaving_;
  if (leaving_) devices_.measure(leave_);
}

void TouchService::end(std::string reason) {
  status_.running = false;
  give_up(std::move(reason));
}

void TouchService::turn(const Batch& batch, std::size_t points_left, const std::string& seen, WallTime now) {
  if (!status_.running) return;
  if (!looked_) looked_ = now;
  if (now - *looked_ > kLongestUnwatched)
    give_up(fmt::format("cancelled: nobody looked on for {} s", kLongestUnwatched.count()));
  if (leaving_) {
    status_.running = points_left != 0;
    return;
  }
  for (const auto& touch : batch.touches) {
    if (touch.latch != protocol::TouchLatch::Reported) continue;
    if (has(touch.touch_flags, TouchFlag::NoPosition)) {
      refused_ = true;
      return;  // why is known when the driver has heard of it, too
    }
    status_.touches.push_back(touch);
    return ask_next();  // one at a time is asked for: another one was made by hand
  }
  if (points_left != 0) return;
  end(fmt::format("touch {} of {} {}: {}", status_.touches.size() + 1, status_.asked,
                  refused_ ? "was refused" : "was not made",
                  seen.empty() ? "the machine reported nothing" : seen));
}

}  // namespace abbe::daemon
