#include "abbe/drivers/ippdme/device.hpp"

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
      receiver_(options.receiver) {
  show();
}

IppDevice::~IppDevice() {
  try {
    leave(IppStopRequested{});
  } catch (...) {  // NOLINT(bugprone-empty-catch): out of memory; a server ends the session of a lost client
  }
}

void IppDevice::measure(std::span<const ProbePoint> points) {
  const std::lock_guard lock{requests_mutex_};
  requests_.insert(requests_.end(), points.begin(), points.end());
  points_left_.fetch_add(points.size(), std::memory_order_release);  // pairs with points_left()
}

void IppDevice::wait(std::chrono::nanoseconds at_most) {
  read_mail();
  read_requests();
  tell(IppTick{});
  poll(at_most);
  show();
  count_points();
}

DeviceStatus IppDevice::status() const {
  return board_.read(options_.name, touches_.dropped() + positions_.dropped(), raw_.dropped());
}

void IppDevice::read_requests() {
  std::vector<ProbePoint> requests;
  {
    const std::lock_guard lock{requests_mutex_};
    requests.swap(requests_);
  }
  const auto lost = session().fault().count;  // while they are told: what is behind is void
  for (const ProbePoint& point : requests)
    if (session().fault().count == lost) tell(point);
}

void IppDevice::count_points() {
  const std::lock_guard lock{requests_mutex_};
  points_left_.store(requests_.size() + session().points_left(), std::memory_order_release);
}

std::span<const std::byte> IppDevice::encode(const IppSend& command) {
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
