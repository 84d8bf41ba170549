#include "abbe/drivers/ippdme/device.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace abbe::drivers {

Result<std::unique_ptr<IppDevice>> IppDevice::create(const IppDeviceOptions& options,
                                                     const TimeSource& time) {
  const TcpPeer peer = tcp_peer(options.name, options.host, options.port);
  IppDeviceOptions named = options;
  named.session.peer = peer.name;
  if (const auto fine = check(named.session); !fine) return tl::unexpected{fine.error()};
  if (const auto fine = check(peer); !fine) return tl::unexpected{fine.error()};
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
    tell(IppStopRequested{});
    await_standstill();
    leave(IppStopRequested{});
  } catch (
      ...) {  // NOLINT(bugprone-empty-catch): out of memory; a server ends the session of a lost client
  }
}

/// Closing the connection before the answer has come would leave it to the server whether the
/// machine stops.
void IppDevice::await_standstill() {
  constexpr auto kLook = std::chrono::milliseconds{20};
  const auto& time_out = options_.session.command_timeout;
  const auto until = std::chrono::steady_clock::now() + time_.wall(time_out);
  while (session().state() == IppState::Aborting && std::chrono::steady_clock::now() < until) {
    wait(time_.host(kLook));
    receive();
  }
}

void IppDevice::abort() {
  requests_.put(IppAbortRequested{});
}

void IppDevice::end() {
  requests_.put(IppStopRequested{});
}

void IppDevice::release() {
  requests_.put(IppReleaseRequested{});
}

void IppDevice::measure(std::span<const ProbePoint> points) {
  asked_.fetch_add(points.size(), std::memory_order_relaxed);
  requests_.put(std::vector<ProbePoint>{
      points.begin(), points.end()});  // orders what was asked before what is finished
}

void IppDevice::wait(std::chrono::nanoseconds at_most) {
  read_mail();
  read_requests();
  if (!reads_before_due()) {
    tell(IppTick{});
    poll(at_most);
  }
  show_session();
  report_machine();
  count_points();
}

void IppDevice::show_session() {
  show();
  held_.store(session().held(), std::memory_order_relaxed);
  releasable_.store(session().releasable(), std::memory_order_relaxed);
}

void IppDevice::report_machine() {
  const IppMachine machine{session().hold_reason(), session().moving()};
  if (machine == machine_) return;
  machine_ = machine;
  if (options_.machine_changed) options_.machine_changed(machine);
}

DeviceStatus IppDevice::status() const {
  return board_.read(options_.name, touches_.dropped() + positions_.dropped(), raw_.dropped());
}

void IppDevice::read_requests() {
  const auto requests = requests_.take();
  const auto is_abort = [](const Request& r) {
    return std::holds_alternative<IppAbortRequested>(r);
  };

  const auto is_end = [](const Request& r) { return std::holds_alternative<IppStopRequested>(r); };
  const auto stops = [&](const Request& r) { return is_abort(r) || is_end(r); };
  const auto asked_again = std::find_if(requests.rbegin(), requests.rend(), stops).base();

  for (auto request = requests.begin(); request != requests.end(); ++request) {
    if (const auto* points = std::get_if<std::vector<ProbePoint>>(&*request)) {
      taken_ += points->size();
      if (request >= asked_again) ask_for(*points);  // what was asked before a stop is not begun
    } else if (is_abort(*request)) {
      tell(IppAbortRequested{});
    } else if (is_end(*request)) {
      tell(IppStopRequested{});
    } else {
      tell(IppReleaseRequested{});
    }
  }
}

void IppDevice::ask_for(const std::vector<ProbePoint>& points) {
  const auto lost = session().fault().count;  // while they are told: what is behind is void
  for (const ProbePoint& point : points)
    if (session().fault().count == lost) tell(point);
}

void IppDevice::count_points() {
  finished_.store(taken_ - session().points_left(),
                  std::memory_order_release);  // pairs with points_left()
}

std::span<const std::byte> IppDevice::encode(const IppSend& command) {
  report_machine();  // kept before the machine moves
  const auto bytes = std::as_bytes(std::span{command.line});
  const protocol::HostTime now = time_.now();  // once: a replay knows only the recorded one
  raw_.push_bytes(now, protocol::RawBlock::Direction::ToDevice, bytes);
  receiver_.sent(bytes, now);
  return bytes;
}

/// The receiver must hear of the new connection before of the first command on it.
void IppDevice::connected() {
  raw_.push_bytes(arrival_, protocol::RawBlock::Direction::FromDevice, {});
  receiver_.push({}, arrival_);
}

}  // namespace abbe::drivers
