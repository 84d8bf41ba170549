#include "abbe/sim/encoder_bus.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <ctime>
#include <utility>

#include "abbe/protocol/can/udp_framing.hpp"

namespace abbe::sim {
namespace {

constexpr std::size_t kLargestDatagram = 65536;
constexpr std::size_t kOutgoingDatagram = 1400;  // below every Ethernet MTU, as the tunnel does by default
constexpr std::uint16_t kGenericEmergency = 0x1000;

/// How long ago the kernel took a datagram in; zero when it did not say or its clock was stepped meanwhile.
std::chrono::nanoseconds age_of(const msghdr& message) {
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr;
       c = CMSG_NXTHDR(const_cast<msghdr*>(&message), c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec stamp{};
    timespec now{};
    std::memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
    clock_gettime(CLOCK_REALTIME, &now);
    const std::chrono::nanoseconds age{(now.tv_sec - stamp.tv_sec) * 1'000'000'000 + now.tv_nsec -
                                       stamp.tv_nsec};
    if (age.count() >= 0 && age < std::chrono::seconds{1}) return age;
  }
  return {};
}

bool concerns(const Fault& fault, const EncoderNode& node) {
  return fault.node == 0 || fault.node == node.node();
}

}  // namespace

Result<EncoderBus> EncoderBus::open(const EncoderBusOptions& options,
                                    std::span<const EncoderNodeOptions> nodes, const VirtualMachine& machine,
                                    HostTime now) {
  auto socket = bind_udp(options.port);
  if (!socket) return tl::unexpected(socket.error());
  const int on = 1;
  if (options.speed > 0.0) setsockopt(socket->get(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  EncoderBus bus(std::move(*socket), options);
  for (const EncoderNodeOptions& node : nodes) bus.nodes_.emplace_back(node, machine, now);
  return bus;
}

EncoderBus::EncoderBus(Socket socket, const EncoderBusOptions& options)
    : socket_(std::move(socket)), port_(port_of(socket_)), speed_(options.speed) {
  if (options.peer_port == 0) return;
  peer_ = loopback_address(options.peer_port);
  has_peer_ = true;
}

void EncoderBus::poll(HostTime now) {
  end_bus_off(now);
  receive(now);
  for (EncoderNode& node : nodes_) node.advance(now);
  std::erase_if(all_clears_, [&](const AllClear& clear) {
    if (now < clear.due) return false;
    for (EncoderNode& node : nodes_) {
      if (node.node() == clear.node) node.emergency(0, 0, now);
    }
    return true;
  });
  collect();
  send_due(now);
}

HostTime EncoderBus::next_due() const {
  HostTime due = waiting_.empty() ? HostTime::max() : waiting_.front().due;
  for (const EncoderNode& node : nodes_) due = std::min(due, node.next_due());
  for (const AllClear& clear : all_clears_) due = std::min(due, clear.due);
  if (bus_off_until_) due = std::min(due, *bus_off_until_);
  return due;
}

void EncoderBus::receive(HostTime now) {
  std::array<std::byte, kLargestDatagram> buffer;  // NOLINT: filled by recvmsg
  // A bound, so that a flood cannot keep the other devices from their turn.
  for (int i = 0; i < 256; ++i) {
    sockaddr_storage from{};
    iovec part{buffer.data(), buffer.size()};
    alignas(cmsghdr) std::array<char, 64> control{};
    msghdr message{};
    message.msg_name = &from;
    message.msg_namelen = sizeof from;
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = ::recvmsg(socket_.get(), &message, MSG_DONTWAIT);
    if (size < 0) return;
    peer_ = from;
    has_peer_ = true;
    const auto age = seconds_to_ns(speed_ * ns_to_seconds(age_of(message)));
    on_datagram(std::span(buffer).first(static_cast<std::size_t>(size)), now - age);
  }
}

void EncoderBus::on_datagram(std::span<const std::byte> bytes, HostTime at) {
  if (bus_off_until_) return;
  auto view = can::DatagramView::parse(bytes);
  if (!view) return;  // what is not ours does not reach the bus
  for (can::CanFrame frame; view->next(frame);) {
    for (EncoderNode& node : nodes_) node.on_frame(frame, at);
  }
  collect();
}

void EncoderBus::collect() {
  for (EncoderNode& node : nodes_) {
    for (const TimedFrame& timed : node.take_frames()) {
      const auto place = std::upper_bound(waiting_.begin(), waiting_.end(), timed.due,
                                          [](HostTime due, const TimedFrame& t) { return due < t.due; });
      waiting_.insert(place, timed);
    }
  }
}

void EncoderBus::send_due(HostTime now) {
  const auto end = std::find_if(waiting_.begin(), waiting_.end(),
                                [now](const TimedFrame& timed) { return timed.due > now; });
  if (has_peer_ && !bus_off_until_) {
    std::array<std::byte, kOutgoingDatagram> buffer{};
    for (auto it = waiting_.begin(); it != end;) {
      can::DatagramWriter writer(buffer, sequence_++);
      while (it != end && writer.add(it->frame)) ++it;
      send_datagram(writer.finish());
    }
  }
  waiting_.erase(waiting_.begin(), end);  // without a listener they are gone, as on a real bus
}

void EncoderBus::send_datagram(std::span<const std::byte> bytes) {
  if (!has_peer_) return;
  ::sendto(socket_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
           reinterpret_cast<const sockaddr*>(&peer_), sizeof(sockaddr_in));
}

void EncoderBus::send_error_frame(can::BusCondition condition) {
  std::array<std::byte, kOutgoingDatagram> buffer{};
  can::DatagramWriter writer(buffer, sequence_++);
  can::BusReport report;
  report.conditions = static_cast<can::BusConditions>(condition);
  if (writer.add(can::encode_error_frame(report))) send_datagram(writer.finish());
}

void EncoderBus::end_bus_off(HostTime now) {
  if (!bus_off_until_ || now < *bus_off_until_) return;
  bus_off_until_.reset();
  send_error_frame(can::BusCondition::Restarted);
}

void EncoderBus::inject(const Fault& fault, HostTime now) {
  const HostTime until = now + seconds_to_ns(fault.duration_s);
  if (fault.kind == FaultKind::BusOff) {
    send_error_frame(can::BusCondition::BusOff);
    bus_off_until_ = until;
    return;
  }
  if (fault.kind == FaultKind::BusGarbage) {
    constexpr std::array<std::byte, 7> kNoDatagram{std::byte{0xff}, std::byte{0xff}, std::byte{0x00},
                                                   std::byte{0x13}, std::byte{0x37}, std::byte{0x02},
                                                   std::byte{0x00}};
    return send_datagram(kNoDatagram);
  }
  for (EncoderNode& node : nodes_) {
    if (!concerns(fault, node)) continue;
    switch (fault.kind) {
      case FaultKind::Mute:
        node.mute_until(until);
        break;
      case FaultKind::Late:
        node.delay_until(until, seconds_to_ns(fault.value));
        break;
      case FaultKind::Restart:
        node.restart(now);
        break;
      case FaultKind::Emergency:
        node.emergency(fault.value > 0.0 ? static_cast<std::uint16_t>(fault.value) : kGenericEmergency, 1,
                       now);
        all_clears_.push_back({until, node.node()});
        break;
      default:
        break;  // a tracker's fault
    }
  }
  collect();
  send_due(now);
}

}  // namespace abbe::sim
