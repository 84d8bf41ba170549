#include "abbe/drivers/lines/tracker_device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>
#include <utility>

#include "abbe/protocol/printable.hpp"
#include "abbe/result/try.hpp"

namespace abbe::drivers {
namespace {

constexpr std::chrono::milliseconds kLineRetry{500};
/// At most one report of unreadable lines in this time: each line may be one.
constexpr std::chrono::seconds kUnreadableReports{1};

double milliseconds_of(std::chrono::nanoseconds d) {
  return std::chrono::duration<double, std::milli>(d).count();
}

/// "2 lines cannot be read; the last one: column 3 (z): not a number: "1.0 2.0 abc"".
std::string text_of_unreadable(std::uint64_t count, const UnreadableLine& line,
                               const lines::LineFormat& format) {
  const std::size_t column = line.fault.column;
  std::string place;
  if (column > 0 && column <= format.column_count)
    place = fmt::format("column {} ({}): ", column, lines::name_of(format.columns[column - 1]));
  else if (column > 0)
    place = fmt::format("column {}: ", column);
  return fmt::format("{} line{} cannot be read{} {}{}: \"{}\"", count, count == 1 ? "" : "s",
                     count == 1 ? ":" : "; the last one:", place, lines::text_of(line.fault.what),
                     protocol::printable_line(line.text()));
}

}  // namespace

LineReceiverOptions receiver_options(const LineTrackerOptions& options) {
  LineReceiverOptions receiver = options.receiver;
  receiver.datagrams = std::holds_alternative<LineUdp>(options.address);
  receiver.begins_anywhere = std::holds_alternative<LineSerial>(options.address);
  return receiver;
}

Result<std::unique_ptr<LineTrackerDevice>> LineTrackerDevice::create(
    const LineTrackerOptions& options, const TimeSource& time) {
  const auto refused = [&](std::string_view what) {
    return tl::unexpected{
        Error{ErrorCode::BadConfiguration, fmt::format("{}: {}", options.name, what)}};
  };
  if (const auto valid = check(options.address); !valid) return refused(valid.error().text);
  if (const auto what = lines::format_fault(options.receiver.format); !what.empty())
    return refused(fmt::format("the format of the lines {}", what));
  return std::unique_ptr<LineTrackerDevice>{new LineTrackerDevice{options, time}};
}

LineTrackerDevice::LineTrackerDevice(const LineTrackerOptions& options, const TimeSource& time)
    : options_(options),
      name_(fmt::format("{} {}", options.name, text_of(options.address))),
      time_(time),
      link_(options.address),
      points_(options.point_capacity),
      raw_(options.raw_capacity_blocks),
      receiver_(receiver_options(options)),
      due_(time.now()) {
  board_.set_state("disconnected");
}

void LineTrackerDevice::wait(std::chrono::nanoseconds at_most) {
  look_at_lines();
  report_unreadable();
  report_times();
  report_rate();
  if (waits_to_open_ && time_.now() >= due_) open();
  await_bytes(at_most);
}

void LineTrackerDevice::open() {
  waits_to_open_ = false;
  due_ = link_.awaits_sender() ? protocol::HostTime::max() : time_.now() + options_.connect_timeout;
  if (const auto opened = link_.open(); !opened) return lose(opened.error().text);
  board_.set_state(link_.awaits_sender() ? "waiting for the sender" : "connecting");
}

/// A time-out is judged only after the bytes that wait were read: when the thread was delayed, the
/// deadline has passed although there are lines.
void LineTrackerDevice::await_bytes(std::chrono::nanoseconds at_most) {
  const bool overdue_now = !waits_to_open_ && due_ <= time_.now();
  if (overdue_now) {
    if (!take_ready(std::chrono::nanoseconds{0})) overdue();
    return;
  }
  const auto now = time_.now();
  const auto until_due = due_ == protocol::HostTime::max() ? at_most : due_ - now;
  static_cast<void>(
      take_ready(time_.wall(std::clamp(until_due, std::chrono::nanoseconds{0}, at_most))));
}

/// False: nothing happened within `wall`.
bool LineTrackerDevice::take_ready(std::chrono::nanoseconds wall) {
  const auto ready = link_.wait(wall);
  if (!ready)
    lose(ready.error().text);
  else if (*ready == LineLink::Ready::Established)
    established();
  else if (*ready == LineLink::Ready::Readable)
    read();
  else
    return false;
  return true;
}

void LineTrackerDevice::established() {
  arrival_ = time_.now();
  began_ = true;
  board_.set_state("connected");
  due_ = time_.now() + options_.silence_timeout;
}

void LineTrackerDevice::read() {
  arrival_ = time_.now();
  discard_reads();
  bool truncated = false;
  do {
    const auto got = link_.read(std::span{buffer_}.subspan(filled_).first(kMostRead));
    if (!got) return lose(got.error().text);
    if (got->bytes == 0) break;
    truncated = truncated || got->truncated;
    filled_ += got->bytes;
    read_sizes_[read_count_++] = got->bytes;
  } while (link_.datagrams() && read_count_ < kMostReads && filled_ + kMostRead <= buffer_.size());
  if (truncated)
    fault(
        fmt::format("a datagram was larger than {} bytes, the rest of it is lost: send less lines "
                    "in one datagram",
                    kMostRead));
}

void LineTrackerDevice::lose(const std::string& why) {
  close();
  board_.set_state("disconnected");
  fault_once(why);
  open_later(kLineRetry);
}

void LineTrackerDevice::close() {
  if (link_.established())
    raw_.push_bytes(time_.now(), protocol::RawBlock::Direction::ToDevice, {});
  link_.close();
  discard_reads();
  began_ = false;
  board_.set_connected(false);
}

void LineTrackerDevice::open_later(std::chrono::nanoseconds pause) {
  waits_to_open_ = true;
  due_ = time_.now() + pause;
}

/// No connection, or no line on it, in time.
void LineTrackerDevice::overdue() {
  const bool established = link_.established();
  board_.set_state("faulted");
  board_.set_connected(false);
  fault_once(established
                 ? fmt::format("no line in {:.4g} s: check that the program that sends is running, "
                               "measures, and sends to this address",
                               std::chrono::duration<double>(options_.silence_timeout).count())
                 : fmt::format("no connection in {:.4g} s",
                               std::chrono::duration<double>(options_.connect_timeout).count()));
  due_ = protocol::HostTime::max();
  if (established && !link_.connection_oriented()) return;  // there is nothing to open again
  close();
  open_later(kLineRetry);
}

/// The lines that receive() has read in the last cycle.
void LineTrackerDevice::look_at_lines() {
  const LineCounters counters = receiver_.counters();
  const std::uint64_t seen = counters.points + counters.headings + counters.unreadable;
  const bool points = counters.points != std::exchange(points_seen_, counters.points);
  if (seen == std::exchange(lines_seen_, seen) || !link_.established()) return;
  board_.set_connected(true);
  due_ = time_.now() + options_.silence_timeout;
  if (points) {
    board_.set_state("streaming");
    reported_.clear();
  } else if (counters.unreadable != unreadable_reported_) {
    board_.set_state("unreadable lines");
  }
}

void LineTrackerDevice::report_unreadable() {
  const std::uint64_t unreadable = receiver_.counters().unreadable;
  if (unreadable == unreadable_reported_ || time_.now() < unreadable_report_at_) return;
  unreadable_report_at_ = time_.now() + kUnreadableReports;
  fault(text_of_unreadable(unreadable - std::exchange(unreadable_reported_, unreadable),
                           receiver_.unreadable(), options_.receiver.format));
}

/// Reports points whose time did not fit, jumps of the sender's clock, its rate, and senders that
/// were turned away.
void LineTrackerDevice::report_times() {
  const auto& counters = receiver_.counters().times;
  const auto refused =
      counters.time_disorder - std::exchange(times_refused_seen_, counters.time_disorder);
  const auto jumps = counters.time_jumps - std::exchange(time_jumps_seen_, counters.time_jumps);
  if (jumps > 0)
    fault(
        "the sender's clock jumped: the points before and after the jump are not used together; "
        "do not set its clock during a run");
  else if (refused > 0)
    fault(
        fmt::format("the times of {} points do not fit those of the others: these points are not "
                    "used",
                    refused));

  const double skew = receiver_.skew_beyond_limit();
  if (!std::exchange(clock_reported_, skew != 0.0) && skew != 0.0) {
    constexpr double kPpm = 1e6;
    fault(
        fmt::format("the sender's clock runs {:.0f} ppm {}, a sound one at most {:.0f} ppm: its "
                    "points are marked ClockUnsettled; check the unit of the time column",
                    kPpm * std::abs(skew), skew > 0.0 ? "fast" : "slow",
                    kPpm * options_.receiver.clock.max_skew));
  }

  const auto away = link_.turned_away();
  if (away != std::exchange(turned_away_seen_, away))
    fault("a second sender was turned away while one is connected");
}

void LineTrackerDevice::report_rate() {
  const auto other = receiver_.other_separation();
  if (std::exchange(rate_reported_, other.count() != 0) || other.count() == 0) return;
  fault(
      fmt::format("a point comes every {:.4g} ms, point_rate_hz states {:.4g} ms: gaps are marked "
                  "in the wrong places; set point_rate_hz = {:.6g}",
                  milliseconds_of(other), milliseconds_of(options_.receiver.time_separation),
                  1e3 / milliseconds_of(other)));
}

void LineTrackerDevice::fault(const std::string& what) {
  board_.fault(time_.now(), name_ + ": " + what);
}

/// The same cause, found again with every attempt, counts once.
void LineTrackerDevice::fault_once(const std::string& what) {
  if (what == reported_) return;
  reported_ = what;
  fault(what);
}

DeviceStatus LineTrackerDevice::status() const {
  return board_.read(options_.name, points_.dropped(), raw_.dropped());
}

}  // namespace abbe::drivers
