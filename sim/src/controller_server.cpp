#include "abbe/sim/controller_server.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <type_traits>
#include <utility>

#include "abbe/sim/ippdme_device.hpp"
#include "abbe/sim/recorded_dialogue.hpp"
#include "abbe/sim/recorded_tracker.hpp"
#include "abbe/sim/tracker_device.hpp"

namespace abbe::sim {
namespace {

// a client with more unsent bytes has stopped reading: its connection is closed
constexpr std::size_t kMostUnsent = 32u << 20;

/// Refuses a second client. A tracker controller sends the reason; I++ DME and Modbus have no
/// message for it.
template <class Controller>
void refuse_client(const Socket& accepted) {
  if constexpr (std::is_same_v<Controller, IppDmeDevice> ||
                std::is_same_v<Controller, RecordedDialogue>)
    return;
  std::array<std::byte, 64> packet{};
  const std::size_t size = emscon::encode(
      emscon::ErrorResponse{emscon::Command{}, emscon::Status::MultipleConnectionsNotAllowed},
      std::span(packet));
  ::send(accepted.get(), packet.data(), size, MSG_DONTWAIT | MSG_NOSIGNAL);
}

}  // namespace

template <class Controller>
void ControllerServer<Controller>::poll(HostTime now) {
  accept_clients(now);
  read(now);
  device_->advance(now);
  write();
  if (client_ && device_->wants_close() && unsent_.empty()) drop_client();
}

template <class Controller>
void ControllerServer<Controller>::accept_clients(HostTime now) {
  for (;;) {
    Socket accepted(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!accepted) return;
    device_->advance(now);
    if (!device_->accepts()) continue;  // the controller restarts: the connection is closed at once
    if (client_) read(now);             // detects that the client has disconnected
    if (client_) {
      refuse_client<Controller>(accepted);
      continue;
    }
    const int on = 1;
    setsockopt(accepted.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    client_ = std::move(accepted);
    device_->connected(now);
  }
}

template <class Controller>
void ControllerServer<Controller>::read(HostTime now) {
  std::array<std::byte, 4096> buffer;  // NOLINT: filled by recv
  while (client_) {
    const ssize_t size = ::recv(client_.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (size > 0) {
      device_->receive(std::span(buffer).first(static_cast<std::size_t>(size)), now);
    } else if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) {
      return;
    } else {
      drop_client();
    }
  }
}

template <class Controller>
void ControllerServer<Controller>::write() {
  const std::vector<std::byte> more = device_->take_output();
  if (!client_) return;
  unsent_.insert(unsent_.end(), more.begin(), more.end());
  send_what_fits(client_, unsent_, most_per_poll_);
  if (unsent_.size() > kMostUnsent) drop_client();
}

template <class Controller>
void ControllerServer<Controller>::drop_client() {
  client_.close();
  unsent_.clear();
  device_->disconnected();
}

template class ControllerServer<TrackerDevice>;
template class ControllerServer<RecordedTracker>;
template class ControllerServer<IppDmeDevice>;
template class ControllerServer<RecordedDialogue>;

}  // namespace abbe::sim
