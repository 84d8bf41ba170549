#include "abbe/drivers/lines/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>
#include <utility>

#include "abbe/protocol/printable.hpp"

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
                               std::span<const std::string> columns) {
  const std::size_t column = line.fault.column;
  std::string place;
  if (column > 0 && column <= columns.size())
    place = fmt::format("column {} ({}): ", column, columns[column - 1]);
  else if (column > 0)
    place = fmt::format("column {}: ", column);
  return fmt::format("{} line{} cannot be read{} {}{}: \"{}\"", count, count == 1 ? "" : "s",
                     count == 1 ? ":" : "; the last one:", place, lines::text_of(line.fault.what),
                     protocol::printable_line(line.text()));
}

}  // namespace

LineSession::LineSession(LineSessionOptions options, LineTexts texts, const TimeSource& time)
    : options_(std::move(options)),
      texts_(std::move(texts)),
      name_(fmt::format("{} {}", options_.name, text_of(options_.address))),
      time_(time),
      link_(options_.address),
      raw_(options_.raw_capacity_blocks),
      due_(time.now()) {
  board_.set_state("disconnected");
}

void LineSession::report(const LineReception& found) {
  look_at_lines(found.counters);
  report_unreadable(found);
  report_times(found.counters.times);
  report_skew(found.skew_beyond_limit);
  report_rate(found.other_separation);
  report_condition(found);
  report_turned_away();
}

void LineSession::wait(std::chrono::nanoseconds at_most) {
  if (waits_to_open_ && time_.now() >= due_) open();
  await_bytes(at_most);
}

void LineSession::open() {
  waits_to_open_ = false;
  due_ = link_.awaits_sender() ? protocol::HostTime::max() : time_.now() + options_.connect_timeout;
  if (const auto opened = link_.open(); !opened) return lose(opened.error().text);
  board_.set_state(link_.awaits_sender() ? "waiting for the sender" : "connecting");
}

/// A time-out is judged only after the bytes that wait were read: when the thread was delayed, the
/// deadline has passed although there are lines.
void LineSession::await_bytes(std::chrono::nanoseconds at_most) {
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
bool LineSession::take_ready(std::chrono::nanoseconds wall) {
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

void LineSession::established() {
  arrival_ = time_.now();
  began_ = true;
  board_.set_state("connected");
  due_ = time_.now() + options_.silence_timeout;
}

void LineSession::read() {
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

void LineSession::lose(const std::string& why) {
  close();
  board_.set_state("disconnected");
  fault_once(why);
  open_later(kLineRetry);
}

void LineSession::close() {
  if (link_.established())
    raw_.push_bytes(time_.now(), protocol::RawBlock::Direction::ToDevice, {});
  link_.close();
  discard_reads();
  began_ = false;
  board_.set_connected(false);
}

void LineSession::open_later(std::chrono::nanoseconds pause) {
  waits_to_open_ = true;
  due_ = time_.now() + pause;
}

/// No connection, or no line on it, in time.
void LineSession::overdue() {
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

/// The lines that were read in the last cycle.
void LineSession::look_at_lines(const LineCounters& counters) {
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

void LineSession::report_unreadable(const LineReception& found) {
  const std::uint64_t unreadable = found.counters.unreadable;
  if (unreadable == unreadable_reported_ || time_.now() < unreadable_report_at_) return;
  unreadable_report_at_ = time_.now() + kUnreadableReports;
  fault(text_of_unreadable(unreadable - std::exchange(unreadable_reported_, unreadable),
                           found.unreadable, texts_.columns));
}

/// Reports samples whose time did not fit, and jumps of the sender's clock.
void LineSession::report_times(const BurstTimeCounters& counters) {
  const auto refused =
      counters.time_disorder - std::exchange(times_refused_seen_, counters.time_disorder);
  const auto jumps = counters.time_jumps - std::exchange(time_jumps_seen_, counters.time_jumps);
  const auto many = texts_.words.many;
  if (jumps > 0)
    fault(
        fmt::format("the sender's clock jumped: the {} before and after the jump are not used "
                    "together; do not set its clock during a run",
                    many));
  else if (refused > 0)
    fault(fmt::format("the times of {} {} do not fit those of the others: these {} are not used",
                      refused, many, many));
}

void LineSession::report_skew(double skew) {
  if (std::exchange(clock_reported_, skew != 0.0) || skew == 0.0) return;
  constexpr double kPpm = 1e6;
  fault(
      fmt::format("the sender's clock runs {:.0f} ppm {}, a sound one at most {:.0f} ppm: its {} "
                  "are marked ClockUnsettled; check the unit of the time column",
                  kPpm * std::abs(skew), skew > 0.0 ? "fast" : "slow", kPpm * texts_.max_skew,
                  texts_.words.many));
}

void LineSession::report_rate(std::chrono::nanoseconds other) {
  if (std::exchange(rate_reported_, other.count() != 0) || other.count() == 0) return;
  const LineWords& words = texts_.words;
  const double other_ms = milliseconds_of(other);
  fault(
      fmt::format("a {} comes every {:.4g} ms, {} states {:.4g} ms: gaps are marked in the wrong "
                  "places; set {} = {:.6g}",
                  words.one, other_ms, words.rate_key, milliseconds_of(texts_.time_separation),
                  words.rate_key, 1e3 / other_ms));
}

void LineSession::report_condition(const LineReception& found) {
  std::string_view condition;
  if (found.invalid)
    condition = "the status column marks the measurements as invalid: they are not used";
  else if (found.together)
    condition =
        "several lines come together, of which only the newest can be used without a time column: "
        "let the sender print its time, or each line at once";
  if (std::exchange(condition_, condition) != condition)
    board_.set_condition(time_.now(), condition);
}

void LineSession::report_turned_away() {
  const auto away = link_.turned_away();
  if (away != std::exchange(turned_away_seen_, away))
    fault("a second sender was turned away while one is connected");
}

void LineSession::fault(const std::string& what) {
  board_.fault(time_.now(), name_ + ": " + what);
}

/// The same cause, found again with every attempt, counts once.
void LineSession::fault_once(const std::string& what) {
  if (what == reported_) return;
  reported_ = what;
  fault(what);
}

DeviceStatus LineSession::status(std::uint64_t dropped) const {
  return board_.read(options_.name, dropped, raw_.dropped());
}

}  // namespace abbe::drivers
