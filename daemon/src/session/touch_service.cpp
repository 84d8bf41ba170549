#include "abbe/daemon/touch_service.hpp"

#include <fmt/format.h>

#include <utility>

namespace abbe::daemon {

using protocol::TouchFlag;

Result<void> TouchService::start(std::vector<TouchRequest> requests) {
  if (!configured_)
    return fail(ErrorCode::Refused, "touch: there is no measuring machine, [cmm], in the configuration");
  if (status_.running) return fail(ErrorCode::Refused, "touch: touches are under way already");
  if (requests.empty()) return fail(ErrorCode::Usage, "touch: no point to touch");
  status_ = {.running = true, .asked = requests.size(), .touches = {}, .reason = {}};
  waiting_.assign(std::make_move_iterator(requests.begin()), std::make_move_iterator(requests.end()));
  ask_next();
  return {};
}

Result<void> TouchService::cancel() {
  if (!status_.running) return fail(ErrorCode::Refused, "touch: no touches are under way");
  status_.reason = "cancelled";
  waiting_.clear();
  return {};
}

void TouchService::ask_next() {
  status_.running = !waiting_.empty();
  refused_ = false;
  if (!status_.running) return;
  std::vector<drivers::ProbePoint> points = std::move(waiting_.front().way);
  points.push_back(waiting_.front().point);
  waiting_.pop_front();
  devices_.measure(points);
}

void TouchService::end(std::string reason) {
  status_.running = false;
  if (status_.reason.empty()) status_.reason = std::move(reason);
  waiting_.clear();
}

void TouchService::turn(const Batch& batch, std::size_t points_left, const std::string& seen) {
  if (!status_.running) return;
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
