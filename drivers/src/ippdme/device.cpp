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
    handle(IppStopRequested{});
    await_standstill();
    leave(IppStopRequested{});
  } catch (...) {  // NOLINT(bugprone-empty-catch)
    // Out of memory: the connection closes, and the server ends the session of a lost client.
  }
}

/// Waits until AbortE is answered: if the connection were closed before, the machine might not
/// stop.
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
  // put() also orders the increment of asked_ before the device thread counts these points as
  // finished.
  requests_.put(std::vector<ProbePoint>{points.begin(), points.end()});
}

void IppDevice::wait(std::chrono::nanoseconds at_most) {
  handle_posted_messages();
  read_requests();
  if (!reads_before_due()) {
    handle(IppTick{});
    poll(at_most);
  }
  show_session();
  report_machine();
  count_points();
}

void IppDevice::show_session() {
  show();
  emergency_stop_.set_moving(session().moving());
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

/// First without the session, whose state is unknown after an exception: it may count AbortE as sent
/// although it is not. A second AbortE changes nothing. A message of the server that caused the
/// exception is not handled again.
bool IppDevice::stop_after_failure() {
  if (!session().moving()) return false;
  emergency_stop_.set_moving(true);
  (void)send_emergency_stops({});
  discard_posted_messages();
  handle(IppAbortRequested{});
  show_session();
  return session().moving();
}

void IppDevice::read_requests() {
  const auto requests = requests_.take();
  const auto is_abort = [](const Request& r) {
    return std::holds_alternative<IppAbortRequested>(r);
  };

  const auto is_end = [](const Request& r) { return std::holds_alternative<IppStopRequested>(r); };
  const auto stops = [&](const Request& r) { return is_abort(r) || is_end(r); };
  const auto after_last_stop = std::find_if(requests.rbegin(), requests.rend(), stops).base();

  for (auto request = requests.begin(); request != requests.end(); ++request) {
    if (const auto* points = std::get_if<std::vector<ProbePoint>>(&*request)) {
      taken_ += points->size();
      if (request >= after_last_stop) request_points(*points);  // earlier points are not begun
    } else if (is_abort(*request)) {
      handle(IppAbortRequested{});
    } else if (is_end(*request)) {
      handle(IppStopRequested{});
    } else {
      handle(IppReleaseRequested{});
    }
  }
}

/// Passes points to the session. If one of them causes a fault, the remaining ones are discarded.
void IppDevice::request_points(const std::vector<ProbePoint>& points) {
  const auto faults_before = session().fault().count;
  for (const ProbePoint& point : points)
    if (session().fault().count == faults_before) handle(point);
}

void IppDevice::count_points() {
  // release: pairs with the acquire in points_left()
  finished_.store(taken_ - session().points_left(), std::memory_order_release);
}

std::span<const std::byte> IppDevice::encode(const IppSend& command) {
  report_machine();  // the state is stored before the machine moves
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
