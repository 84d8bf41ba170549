#include "abbe/drivers/environment/device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::drivers {

using protocol::HostTime;
using protocol::RawBlock;
using std::chrono::nanoseconds;

namespace {

bool has_address(const ModbusAddress& address) {
  const auto* tcp = std::get_if<ModbusTcp>(&address);
  return tcp != nullptr ? !tcp->host.empty() && tcp->port != 0
                        : !std::get<ModbusSerial>(address).path.empty();
}

auto in_ms(nanoseconds t) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(t).count();
}

}  // namespace

Result<std::unique_ptr<EnvironmentDevice>> EnvironmentDevice::create(
    const EnvironmentDeviceOptions& options, const TimeSource& time) {
  auto own = std::make_unique<EnvironmentLink>();
  EnvironmentLink& link = *own;
  auto device = create(options, time, link);
  if (device) (*device)->own_link_ = std::move(own);
  return device;
}

Result<std::unique_ptr<EnvironmentDevice>> EnvironmentDevice::create(
    const EnvironmentDeviceOptions& options, const TimeSource& time, EnvironmentLink& link) {
  ABBE_TRY(check(options.map));
  if (!has_address(options.address))
    return tl::unexpected(
        Error{ErrorCode::BadConfiguration, options.name + ": host, port or path is missing"});
  if (options.period <= nanoseconds{0})
    return tl::unexpected(
        Error{ErrorCode::BadConfiguration, options.name + ": period must be above 0"});
  return std::unique_ptr<EnvironmentDevice>{new EnvironmentDevice{options, time, link}};
}

EnvironmentDevice::EnvironmentDevice(const EnvironmentDeviceOptions& options,
                                     const TimeSource& time, EnvironmentLink& link)
    : options_(options),
      time_(time),
      samples_(options.sample_capacity),
      raw_(options.raw_capacity_blocks),
      receiver_(options.map, transport_of(options.address)),
      link_(link) {
  board_.set_state("closed");
}

DeviceStatus EnvironmentDevice::status() const {
  return board_.read(options_.name, samples_.dropped(), raw_.dropped());
}

void EnvironmentDevice::wait(nanoseconds at_most) {
  handle_progress(time_.now());
  if (!ensure_open(at_most)) return;
  send_request();
  if (on_line()) read_answer(at_most);
}

bool EnvironmentDevice::busy() const noexcept {
  return progress_ != Progress::Waiting || (on_line() && receiver_.awaiting());
}

HostTime EnvironmentDevice::due() const noexcept {
  if (!link_.line.is_open()) return std::max(open_at_, link_.open_at);
  if (!on_line()) return open_at_;
  return receiver_.between_rounds() ? next_round_ : arrival_;
}

void EnvironmentDevice::handle_progress(HostTime now) {
  const auto progress = std::exchange(progress_, Progress::Waiting);
  if (progress == Progress::Failed) {
    const bool refused = is_refusal(receiver_.failure());
    return fail(text_of(receiver_.failure(), receiver_.map()),
                refused ? options_.refused_retry : options_.retry, refused ? "refused" : "closed");
  }

  if (progress == Progress::Waiting) return;
  ++answers_;
  ++link_.answers;
  board_.set_connected(true);
  board_.set_state(receiver_.proven() ? "reading" : "proving");

  if (progress == Progress::Sample) plan_next_round(now);
  const auto implausible = receiver_.counters().implausible;
  if (std::exchange(implausible_seen_, implausible) != implausible)
    board_.fault(now, fmt::format("{} {}: a value is outside the plausible range and is not used",
                                  options_.name, text_of(options_.address)));
}

/// Sets the next round to the next multiple of the period; rounds that are already late are
/// omitted.
void EnvironmentDevice::plan_next_round(HostTime now) {
  const auto late = std::max(now - next_round_, nanoseconds{0});
  next_round_ += options_.period * (late / options_.period + 1);
}

bool EnvironmentDevice::ensure_open(nanoseconds at_most) {
  if (on_line()) return true;
  const auto now = time_.now();
  if (const auto from = due(); now < from) {
    // A device on a shared line does not sleep, because other devices use the line meanwhile.
    if (own_link_)
      std::this_thread::sleep_for(time_.wall(std::min(at_most, nanoseconds{from - now})));
    return false;
  }

  if (!link_.line.is_open() && !open_line()) return false;
  opening_ = link_.openings;
  receiver_.begin();
  raw_.push_bytes(now, RawBlock::Direction::FromDevice, {});
  next_round_ = now;
  arrival_ = now;
  board_.set_state("proving");

  return true;
}

bool EnvironmentDevice::open_line() {
  const auto opened = link_.line.open(options_.address, options_.connect_timeout);
  if (opened) ++link_.openings;
  if (!opened) fail(opened.error().text, options_.retry);
  return opened.has_value();
}

void EnvironmentDevice::send_request() {
  const auto request = receiver_.next_request();
  const auto at = time_.now();  // read before sending: no answer is earlier than its request
  if (!request || (receiver_.between_rounds() && at < next_round_)) return;
  if (const auto sent = link_.line.send(*request); !sent) return lose(sent.error().text);
  receiver_.sent(*request, at);
  answer_due_ = at + options_.answer_timeout;
  std::array<std::byte, modbus::kMaxAduSize> frame{};
  const auto length = modbus::encode(*request, transport_of(options_.address), frame);
  raw_.push_bytes(at, RawBlock::Direction::ToDevice, std::span{frame}.first(length));
}

void EnvironmentDevice::read_answer(nanoseconds at_most) {
  const auto due = receiver_.awaiting() ? answer_due_ : next_round_;
  const auto budget = std::clamp(nanoseconds{due - time_.now()}, nanoseconds{0}, at_most);
  const auto read = link_.line.read(buffer_, time_.wall(budget));
  arrival_ = time_.now();
  if (!read) return lose(read.error().text);
  filled_ = *read;
  if (filled_ == 0 && receiver_.awaiting() && arrival_ >= answer_due_)
    fail(fmt::format("no answer in {} ms", in_ms(options_.answer_timeout)), options_.retry,
         "closed", options_.answer_timeout);
}

/// Handles a lost connection. A recording shows it as an empty block ToDevice.
void EnvironmentDevice::lose(std::string_view what) {
  raw_.push_bytes(time_.now(), RawBlock::Direction::ToDevice, {});
  link_.line.close();
  fail(what, options_.retry);
}

void EnvironmentDevice::line_closed() noexcept {
  if (std::exchange(opening_, 0) == 0) return;
  board_.set_connected(false);
  board_.set_state("closed");
}

/// True if another device has answered since the latest fault of this device: then the connection
/// works.
bool EnvironmentDevice::others_answered() noexcept {
  const auto others = link_.answers - answers_;
  return std::exchange(others_at_fault_, others) != others;
}

/// Leaves the line after a fault. If other devices answer, the line stays open: it is not used
/// while a late answer may still arrive, and this device waits at least one period, so that the
/// others complete their rounds. Otherwise the line is closed, and all devices restart on the next
/// connection.
void EnvironmentDevice::leave_line(nanoseconds retry, nanoseconds quiet) {
  const auto now = time_.now();
  opening_ = 0;
  open_at_ = now + retry;
  if (link_.line.is_open() && others_answered()) {
    open_at_ = now + std::max(retry, options_.period);
    link_.quiet_until = now + quiet;
    return;
  }
  link_.line.close();
  link_.open_at = now + options_.retry;
}

void EnvironmentDevice::fail(std::string_view what, nanoseconds retry, const char* state,
                             nanoseconds quiet) {
  const auto now = time_.now();
  board_.fault(now, fmt::format("{} {}: {}", options_.name, text_of(options_.address), what));
  leave_line(retry, quiet);
  board_.set_connected(false);
  board_.set_state(state);
  filled_ = 0;
}

}  // namespace abbe::drivers
