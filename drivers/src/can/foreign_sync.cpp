#include "abbe/drivers/can/foreign_sync.hpp"

#include <algorithm>
#include <utility>

namespace abbe::drivers {

using protocol::HostTime;

namespace {

constexpr std::chrono::seconds kMeasureFor{1};

}  // namespace

void ForeignSync::opened(HostTime now) {
  const bool short_break = may_send_ && now - heard_until_ < kShortBreak;
  listen_for_ = short_break ? std::clamp(3 * slowest_, kListenAgainFor, kListenFor) : kListenFor;
  may_send_ = false;
  quiet_since_ = now;
  restarts_measuring_ = true;
}

void ForeignSync::heard(HostTime at) {
  may_send_ = false;
  quiet_since_ = at;
  const bool restart = std::exchange(restarts_measuring_, false);

  if (count_++ == 0 || restart) {
    first_ = at;
    intervals_ = 0;
    longest_ = {};
  } else {
    ++intervals_;
    longest_ = std::max(longest_, at - last_);
    slowest_ = std::max(slowest_, at - last_);
  }

  last_ = at;
  if (at - first_ < kMeasureFor || intervals_ == 0) return;
  const auto mean = (at - first_) / static_cast<std::int64_t>(intervals_);
  // otherwise SYNCs may be missing
  const bool complete = intervals_ > 1 && longest_ < mean * 3 / 2;

  if (!period_ || complete) period_ = mean;
  first_ = at;
  intervals_ = 0;
  longest_ = {};
}

bool ForeignSync::may_send(HostTime now) {
  heard_until_ = now;
  if (!may_send_ && quiet_since_ && now >= deadline()) {
    may_send_ = true;
    count_ = intervals_ = 0;
    longest_ = {};
    period_.reset();
  }
  return may_send_;
}

HostTime ForeignSync::deadline() const {
  if (may_send_ || !quiet_since_) return HostTime::max();
  return *quiet_since_ + (present() ? kQuietFor : listen_for_);
}

std::optional<std::chrono::nanoseconds> ForeignSync::period() const {
  if (period_ || intervals_ == 0) return period_;
  return (last_ - first_) / static_cast<std::int64_t>(intervals_);
}

}  // namespace abbe::drivers
