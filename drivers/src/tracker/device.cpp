#include "abbe/drivers/tracker/device.hpp"

#include <utility>

namespace abbe::drivers {

TrackerReceiverOptions receiver_options(const TrackerDeviceOptions& options) {
  TrackerReceiverOptions receiver;
  receiver.clock = options.clock;
  const bool periodic = options.session.mode == TrackerMode::ContinuousTime;
  receiver.time_separation = std::chrono::milliseconds{periodic ? options.session.time_separation_ms : 0};
  receiver.stationary_time = std::chrono::milliseconds{options.session.stationary_time_ms};
  return receiver;
}

Result<std::unique_ptr<TrackerDevice>> TrackerDevice::create(const TrackerDeviceOptions& options,
                                                             const TimeSource& time) {
  const TcpPeer peer = tcp_peer(options.name, options.host, options.port);
  TrackerDeviceOptions named = options;
  named.session.peer = peer.name;
  if (const auto fine = check(named.session); !fine) return tl::unexpected{fine.error()};
  if (const auto fine = check(peer); !fine) return tl::unexpected{fine.error()};
  return std::unique_ptr<TrackerDevice>{new TrackerDevice{named, peer, time}};
}

TrackerDevice::TrackerDevice(const TrackerDeviceOptions& options, TcpPeer peer, const TimeSource& time)
    : SessionOverTcp(std::move(peer), time, TrackerSession{options.session}),
      options_(options),
      points_(options.point_capacity),
      environment_(options.environment_capacity),
      raw_(options.raw_capacity_blocks),
      receiver_(receiver_options(options)) {
  show();
}

TrackerDevice::~TrackerDevice() {
  try {
    leave(TrackerStopRequested{});
  } catch (
      ...) {  // NOLINT(bugprone-empty-catch): out of memory; the closed connection stops the controller too
  }
}

void TrackerDevice::wait(std::chrono::nanoseconds at_most) {
  read_mail();
  tell(TrackerTick{});
  poll(at_most);
  show();
}

DeviceStatus TrackerDevice::status() const {
  return board_.read(options_.name, points_.dropped(), raw_.dropped());
}

std::span<const std::byte> TrackerDevice::encode(const TrackerSend& command) {
  const auto packet = std::span<const std::byte>{command_}.first(emscon::encode(command.request, command_));
  raw_.push_bytes(time_.now(), protocol::RawBlock::Direction::ToDevice, packet);
  return packet;
}

}  // namespace abbe::drivers
