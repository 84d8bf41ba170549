#include "abbe/drivers/ippdme/device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

namespace abbe::drivers {
namespace {

/// Longest host time for storing a state; a longer time is reported. A healthy disk needs a few ms.
constexpr std::chrono::seconds kSavedSoon{1};
constexpr auto kOutcomes = static_cast<std::uint64_t>(IppStopOutcome::NotSent) + 1;

}  // namespace

Result<std::unique_ptr<IppDevice>> IppDevice::create(const IppDeviceOptions& options,
                                                     const TimeSource& time) {
  const TcpPeer peer = tcp_peer(options.name, options.host, options.port);
  IppDeviceOptions named = options;
  named.session.peer = peer.name;
  if (const auto valid = check(named.session); !valid) return tl::unexpected{valid.error()};
  if (const auto valid = check(peer); !valid) return tl::unexpected{valid.error()};
  return std::unique_ptr<IppDevice>{new IppDevice{named, peer, time}};
}

IppDevice::IppDevice(const IppDeviceOptions& options, TcpPeer peer, const TimeSource& time)
    : SessionOverTcp(std::move(peer), time, IppSession{options.session}),
      options_(options),
      touches_(options.touch_capacity),
      positions_(options.position_capacity),
      raw_(options.raw_capacity_blocks),
      receiver_(options.receiver),
      machine_{options.session.held, options.session.moving} {
  show_session();
}

IppDevice::~IppDevice() {
  try {
    finish();
  } catch (...) {  // NOLINT(bugprone-empty-catch)
    // Out of memory: the connection closes, and the server ends the session of a lost client.
  }
}

IppStop IppDevice::finish() {
  if (ended_) return session().stop();
  // stop requests of people since the last cycle; they hold the machine
  read_stops(requests_.take());
  handle(IppStopRequested{});
  await_standstill();
  session().give_up_stop();
  leave(IppStopRequested{});
  report_machine();
  show_session();
  ended_ = true;
  return session().stop();
}

/// Waits until AbortE is answered. If the connection were closed earlier, the machine might not
/// stop.
void IppDevice::await_standstill() {
  constexpr auto kLook = std::chrono::milliseconds{20};
  const auto time_out = options_.session.connect_timeout + options_.session.command_timeout;
  const auto until = std::chrono::steady_clock::now() + time_.wall(time_out);
  while (session().stopping_motion() && std::chrono::steady_clock::now() < until) {
    wait(time_.host(kLook));
    receive();
  }
}

std::uint64_t IppDevice::abort() {
  const auto number = stops_asked_.fetch_add(1, std::memory_order_relaxed) + 1;
  requests_.put(IppAbortRequested{number});
  return number;
}

void IppDevice::end() {
  requests_.put(IppStopRequested{});
}

void IppDevice::release() {
  requests_.put(IppReleaseRequested{});
}

void IppDevice::measure(std::span<const ProbePoint> points) {
  asked_.fetch_add(points.size(), std::memory_order_relaxed);
  // put() also orders the increment of asked_ before the device thread counts these points as
  // finished.
  requests_.put(IppPath{points.begin(), points.end()});
}

void IppDevice::wait(std::chrono::nanoseconds at_most) {
  constexpr std::chrono::milliseconds kLookAtStore{1};
  handle_posted_messages();
  read_requests();
  begin_stored_motion();
  if (!reads_before_due()) {
    handle(IppTick{});
    const bool storing = session().state() == IppState::Storing;
    poll(storing ? std::min(at_most, time_.host(kLookAtStore)) : at_most);
  }
  report_machine();
  show_session();
  count_points();
}

void IppDevice::show_session() {
  show();
  emergency_stop_.set_moving(session().moving());
  held_.store(session().held(), std::memory_order_relaxed);
  releasable_.store(session().releasable(), std::memory_order_relaxed);
  show_stop();
  show_condition();
}

void IppDevice::show_stop() {
  const IppStop& now = session().stop();
  if (now.number == stop_.number && now.outcome == stop_.outcome) return;
  stop_ = now;
  stop_text_.set(time_.now(), now.text);
  // release: pairs with the acquire in last_stop()
  stop_shown_.store(now.number * kOutcomes + static_cast<std::uint64_t>(now.outcome),
                    std::memory_order_release);
}

IppStop IppDevice::last_stop() const {
  const auto shown = stop_shown_.load(std::memory_order_acquire);  // pairs with show_stop()
  return {.number = shown / kOutcomes,
          .outcome = static_cast<IppStopOutcome>(shown % kOutcomes),
          .text = stop_text_.read().text};
}

/// Shows the condition that a person must know at once: the machine may be moving, or its state is
/// not stored, so that abbed would not know it after a restart.
void IppDevice::show_condition() {
  std::string condition = session().danger();
  const auto add = [&condition](std::string_view what) {
    condition += fmt::format("{}{}", condition.empty() ? "" : "; ", what);
  };
  const IppStored now = stored();
  if (now.done || machine_ == IppMachine{})
    unsaved_since_.reset();
  else if (!unsaved_since_)
    unsaved_since_ = time_.now();
  if (unsaved_since_ && !now.fault.empty())
    add(fmt::format("not saved, a restart of abbed would not await a release: {}", now.fault));
  else if (unsaved_since_ && time_.now() - *unsaved_since_ > kSavedSoon)
    add("not saved yet, a restart of abbed would not await a release: the disk does not answer");
  if (condition == condition_) return;
  condition_ = std::move(condition);
  board_.set_condition(time_.now(), condition_);
}

void IppDevice::report_machine() {
  const IppMachine machine{session().hold_reason(), session().may_move()};
  if (machine == machine_) return;
  machine_ = machine;
  if (options_.machine_changed) options_.machine_changed(machine);
}

IppStored IppDevice::stored() const {
  return options_.machine_stored ? options_.machine_stored() : IppStored{.done = true, .fault = {}};
}

void IppDevice::begin_stored_motion() {
  report_machine();
  if (session().state() != IppState::Storing) return;
  const IppStored now = stored();
  if (now.done)
    handle(IppMotionStored{});
  else if (!now.fault.empty())
    handle(IppMotionNotStored{now.fault});
}

DeviceStatus IppDevice::status() const {
  return board_.read(options_.name, touches_.dropped() + positions_.dropped(), raw_.dropped());
}

/// First sends AbortE without the session, because the state of the session is unknown after an
/// exception: the session may assume that AbortE was sent although it was not. A second AbortE has
/// no further effect. A message of the server that caused the exception is not handled again.
bool IppDevice::stop_after_failure() {
  if (!session().may_move()) return false;
  emergency_stop_.set_moving(true);
  (void)send_emergency_stops({});
  discard_posted_messages();
  // The number is that of the latest request: the exception may have lost the request itself.
  handle(IppAbortRequested{.number = stops_asked_.load(std::memory_order_relaxed),
                           .reason = "stopped after an internal error of abbed"});
  show_session();
  return session().may_move();
}

/// Reads the requests, stop requests first, because an exception from a later request must not lose
/// a stop. Paths and releases before the last stop are discarded.
void IppDevice::read_requests() {
  const auto requests = requests_.take();
  const auto after_last_stop = std::find_if(requests.rbegin(), requests.rend(), is_stop).base();
  for (const Request& request : requests)
    if (const auto* path = std::get_if<IppPath>(&request)) taken_ += path->size();

  read_stops(requests);
  for (auto request = after_last_stop; request != requests.end(); ++request) {
    if (const auto* path = std::get_if<IppPath>(&*request))
      handle(*path);
    else
      handle(IppReleaseRequested{});
  }
}

bool IppDevice::is_stop(const Request& request) {
  return std::holds_alternative<IppAbortRequested>(request) ||
         std::holds_alternative<IppStopRequested>(request);
}

void IppDevice::read_stops(const std::vector<Request>& requests) {
  for (const Request& request : requests) {
    if (const auto* abort = std::get_if<IppAbortRequested>(&request))
      handle(*abort);
    else if (std::holds_alternative<IppStopRequested>(request))
      handle(IppStopRequested{});
  }
}

void IppDevice::count_points() {
  // release: pairs with the acquire in points_left()
  finished_.store(taken_ - session().points_left(), std::memory_order_release);
}

std::span<const std::byte> IppDevice::encode(const IppSend& command) {
  emergency_stop_.set_moving(session().moving());
  const auto bytes = std::as_bytes(std::span{command.line});
  const protocol::HostTime now = time_.now();  // one value: a replay has only the recorded time
  raw_.push_bytes(now, protocol::RawBlock::Direction::ToDevice, bytes);
  receiver_.sent(bytes, now);
  return bytes;
}

/// The receiver must be reset for the new connection before the first command on it.
void IppDevice::connected() {
  emergency_stop_.set_socket(descriptor());
  raw_.push_bytes(arrival_, protocol::RawBlock::Direction::FromDevice, {});
  receiver_.push({}, arrival_);
}

}  // namespace abbe::drivers
