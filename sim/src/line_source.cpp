#include "abbe/sim/line_source.hpp"

#include <fmt/format.h>

#include <utility>

namespace abbe::sim {

std::string time_text(DeviceTime t, lines::TimeUnit unit) {
  using lines::TimeUnit;
  const std::int64_t ns = t.time_since_epoch().count();
  switch (unit) {
    case TimeUnit::Seconds:
      return fmt::format("{}.{:06}", ns / 1'000'000'000, ns % 1'000'000'000 / 1000);
    case TimeUnit::Milliseconds:
      return fmt::format("{}.{:03}", ns / 1'000'000, ns % 1'000'000 / 1000);
    case TimeUnit::Microseconds:
      return fmt::format("{}", ns / 1000);
    case TimeUnit::Nanoseconds:
      break;
  }
  return fmt::format("{}", ns);
}

std::string status_text(const lines::LineSyntax& syntax, bool valid) {
  if (!valid) return "bad";
  return syntax.valid_status_count == 0 ? "1" : std::string{syntax.valid_status[0].text()};
}

void LineSource::connected(HostTime now) {
  const DeviceTime t = device_time(times_.clock, power_on_, now);
  if (!grid_) grid_ = t;
  next_point_ = static_cast<std::uint64_t>((t - *grid_) / times_.separation) + (t > *grid_);
  next_print_ = next_print(now);
  if (!first_stream_) first_stream_ = now;
}

void LineSource::disconnected() {
  next_print_.reset();
  out_.clear();
}

HostTime LineSource::next_due() const {
  return next_print_.value_or(HostTime::max());
}

DeviceTime LineSource::next_instant() const {
  return *grid_ + times_.separation * static_cast<std::chrono::nanoseconds::rep>(next_point_);
}

HostTime LineSource::next_print(HostTime after) {
  // The conversion to host time rounds: the line must not be due before its measurement.
  constexpr std::chrono::microseconds kRounding{1};
  if (times_.bursts) return after + burst_interval(times_.seed, bursts_++);
  return host_time(times_.clock, power_on_, next_instant()) + times_.delay + kRounding;
}

void LineSource::advance(HostTime now) {
  while (next_print_ && *next_print_ <= now) {
    const HostTime at = *next_print_;
    print_until(at);
    next_print_ = next_print(at);
  }
}

void LineSource::print_until(HostTime at) {
  const DeviceTime until = device_time(times_.clock, power_on_, at - times_.delay);
  for (;; ++next_point_) {
    const DeviceTime t = next_instant();
    if (t > until) return;
    const HostTime measured = host_time(times_.clock, power_on_, t);
    const std::string line = print({measured, t, next_point_, !invalid_.holds(measured)});
    if (line.empty() || at < mute_until_) continue;
    out_ += line;
    ++points_sent_;
  }
}

std::string LineSource::take_output() {
  if (next_print_ && *next_print_ <= stall_until_) return {};
  return std::exchange(out_, {});
}

bool LineSource::take_hang_up() {
  return std::exchange(hang_up_, false);
}

void LineSource::inject(const Fault& fault, HostTime now) {
  advance(now);
  const HostTime until = now + seconds_to_ns(fault.duration_s);
  switch (fault.kind) {
    case FaultKind::PrismError:
      invalid_ = {now, until};
      return;
    case FaultKind::Stall:
      stall_until_ = until;
      return;
    case FaultKind::Mute:
      mute_until_ = until;
      return;
    case FaultKind::Disconnect:
      hang_up_ = true;
      return;
    case FaultKind::TrackerGarbage:
      out_ += "no line 1 of any tracker\n";
      return;
    default:
      return inject_own(fault, now, until);
  }
}

}  // namespace abbe::sim
