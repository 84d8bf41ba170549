#include "abbe/service/touch_service.hpp"

#include <fmt/format.h>

#include <utility>

#include "abbe/config/capabilities.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

using protocol::TouchFlag;

Result<std::array<double, 3>> TouchService::where() const {
  if (!configured_)
    return fail(ErrorCode::Refused,
                fmt::format("touch: there is no measuring machine, {}, in the configuration",
                            tables_with(Capability::Motion)));
  return devices_.machine_position();
}

Result<TouchJob> touch_job(const MotionVolume& volume, std::vector<TouchRequest> touches,
                           std::vector<drivers::ProbePoint> leave) {
  if (touches.empty()) return fail(ErrorCode::Usage, "touch: no point to touch");
  std::size_t places = leave.size();
  for (const TouchRequest& touch : touches) places += touch.way.size() + 1;
  if (touches.size() > TouchJob::kMostTouches || places > TouchJob::kMostPlaces)
    return fail(
        ErrorCode::Usage,
        fmt::format(
            "touch: {} touches with {} places exceed the limits of one request ({} and {}): "
            "send several requests",
            touches.size(), places, TouchJob::kMostTouches, TouchJob::kMostPlaces));
  ABBE_TRY(check_places(volume, touches, leave));
  TouchJob job{.touches = std::move(touches), .leave = std::move(leave), .made = {}};
  job.made.reserve(job.touches.size());

  return job;
}

Result<void> TouchService::start(TouchJob&& job) {
  const auto stands = where();
  if (!configured_) return tl::unexpected(stands.error());
  if (status_.running) return fail(ErrorCode::Refused, "touch: touches are already running");
  ABBE_TRY(stands);
  status_.running = true;
  status_.asked = job.touches.size();
  status_.reason.clear();
  status_.stop = {};
  std::swap(status_.touches, job.made);
  std::swap(requests_, job.touches);
  std::swap(leave_, job.leave);
  next_ = 0;
  leaving_ = stopping_ = false;
  looked_.reset();
  ask_next();

  return {};
}

Result<void> TouchService::cancel() {
  if (!status_.running) return fail(ErrorCode::Refused, "touch: no touches are running");
  stop("cancelled");
  return {};
}

const TouchService::Status& TouchService::look() {
  looked_.reset();
  return status_;
}

/// Stops the motion. No further motion is requested afterwards, not even a retraction: only the
/// operator can judge which path is free.
void TouchService::stop(std::string reason) {
  if (std::exchange(stopping_, true)) return;
  stop_number_ = devices_.stop_machine().value_or(0);
  next_ = requests_.size();
  status_.reason = std::move(reason);
}

void TouchService::stopping(const Batch& batch, std::size_t points_left) {
  for (const auto& touch : batch.touches) {
    const bool made = touch.latch == protocol::TouchLatch::Reported &&
                      !has(touch.touch_flags, TouchFlag::NoPosition);
    if (made && !leaving_ && status_.touches.size() < status_.asked)
      status_.touches.push_back(touch);
  }
  if (points_left != 0) return;
  status_.stop = devices_.machine_stop();
  const bool outstanding = status_.stop.number < stop_number_ ||
                           status_.stop.outcome == drivers::IppStopOutcome::Pending;
  if (!outstanding) end(status_.reason + "; " + stop_text() + tip_text());
}

std::string TouchService::stop_text() const {
  using enum drivers::IppStopOutcome;
  const auto& [number, outcome, text] = status_.stop;
  if (outcome == None) return {};
  if (outcome == Stopped) return fmt::format("the machine is stopped: {}; ", text);
  return fmt::format("the stop of the machine is {}: {}; ", name_of(outcome), text);
}

std::string TouchService::tip_text() const {
  constexpr double kMillimetresPerMetre = 1e3;
  const auto tip = devices_.tip_place();
  if (!tip) return "the machine did not report the position of the tip";
  const auto mm = [&](std::size_t axis) { return kMillimetresPerMetre * tip->at_m[axis]; };
  return fmt::format("the tip was reported at X {:.3f}, Y {:.3f}, Z {:.3f} mm {:.1f} s before",
                     mm(0), mm(1), mm(2), std::chrono::duration<double>(tip->age).count());
}

std::string TouchService::release_text() const {
  return devices_.release_awaited() ? "; look at the machine, then `abbe machine release`" : "";
}

void TouchService::ask_next() {
  refused_ = false;
  if (next_ == requests_.size()) return leave();
  TouchRequest& next = requests_[next_++];
  next.way.push_back(next.point);
  devices_.measure(next.way);
}

/// After the last touch, retracts along `leave_`, which begins at the last point of the job. If the
/// job ended earlier, the machine does not retract, because from its position no free path is
/// known.
void TouchService::leave() {
  leaving_ = status_.reason.empty() && !leave_.empty();
  status_.running = leaving_;
  if (leaving_) devices_.measure(leave_);
}

void TouchService::end(std::string reason) {
  status_.running = false;
  next_ = requests_.size();
  status_.reason = std::move(reason) + release_text();
}

void TouchService::cycle(const Batch& batch, std::size_t points_left, const std::string& seen,
                         WallTime now) {
  if (!status_.running) return;
  if (!looked_) looked_ = now;
  if (now - *looked_ > kLongestUnwatched)
    stop(fmt::format("cancelled: no client requested the touches for {} s",
                     kLongestUnwatched.count()));
  if (stopping_) return stopping(batch, points_left);

  if (leaving_) {
    status_.running = points_left != 0;
    return;
  }

  for (const auto& touch : batch.touches) {
    if (touch.latch != protocol::TouchLatch::Reported) continue;
    if (has(touch.touch_flags, TouchFlag::NoPosition)) {
      refused_ = true;
      return;  // the driver reports the reason later
    }
    status_.touches.push_back(touch);
    // touches are requested one at a time: a further one in this batch was made by hand
    return ask_next();
  }

  if (points_left != 0) return;
  end(fmt::format("touch {} of {} {}: {}", status_.touches.size() + 1, status_.asked,
                  refused_ ? "was refused" : "was not made",
                  seen.empty() ? "the machine reported nothing" : seen));
}

}  // namespace abbe::daemon
