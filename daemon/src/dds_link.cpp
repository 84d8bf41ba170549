#include "abbe/daemon/dds_link.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "control/unix_socket.hpp"
#include "dds_frames.hpp"
#include "retained_payloads.hpp"

namespace abbe::daemon {
namespace {

struct Pending {
  bool to_send = true;
};

}  // namespace

struct DdsLink::State {
  std::filesystem::path path;
  FileDescriptor listener;
  FileDescriptor peer;
  std::vector<std::byte> out;  ///< what the kernel has not taken yet: at most the rest of one frame
  std::size_t out_begin = 0;
  RetainedPayloads<Pending> durable;
  WallTime last_beat{};
  DdsLinkCounters counters;

  void accept_newest();
  void notice_departure();
  void disconnect();
  bool send_waiting();
  bool send_now(const Frame& frame);
  void send_durable();
};

/// A newer abbe-dds replaces the older one: the older one is hung or already replaced by whoever supervises
/// it.
void DdsLink::State::accept_newest() {
  for (;;) {
    FileDescriptor accepted(::accept4(listener.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!accepted) return;
    disconnect();
    peer = std::move(accepted);
    ++counters.connections;
    last_beat = {};  // the newcomer is owed a beat at once
    for (auto& entry : durable.entries()) entry.extra.to_send = true;
  }
}

/// abbe-dds never speaks; readable means it is gone.
void DdsLink::State::notice_departure() {
  std::byte ignored{};
  const ssize_t n = ::recv(peer.get(), &ignored, 1, MSG_DONTWAIT);
  if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) disconnect();
}

void DdsLink::State::disconnect() {
  peer = FileDescriptor{};
  out.clear();
  out_begin = 0;
}

/// Whether the socket is free for the next frame.
bool DdsLink::State::send_waiting() {
  while (peer && out_begin < out.size()) {
    const ssize_t n =
        ::send(peer.get(), out.data() + out_begin, out.size() - out_begin, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (n >= 0) {
      out_begin += static_cast<std::size_t>(n);
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      return false;
    } else if (errno != EINTR) {
      disconnect();
    }
  }
  if (!out.empty()) ++counters.sent;
  out.clear();
  out_begin = 0;
  return static_cast<bool>(peer);
}

bool DdsLink::State::send_now(const Frame& frame) {
  if (!send_waiting()) return false;
  append_frame(out, frame);
  send_waiting();
  return true;
}

void DdsLink::State::send_durable() {
  for (auto& entry : durable.entries()) {
    if (!entry.extra.to_send) continue;
    if (!send_now({FrameKind::Publish, entry.topic, entry.payload})) return;
    entry.extra.to_send = false;
  }
}

Result<DdsLink> DdsLink::listen(const std::filesystem::path& socket) {
  auto listener = listen_unix(socket);
  if (!listener) return tl::make_unexpected(listener.error());
  auto state = std::make_unique<State>();
  state->path = socket;
  state->listener = std::move(*listener);
  return DdsLink(std::move(state));
}

DdsLink::DdsLink(std::unique_ptr<State> state) : state_(std::move(state)) {}
DdsLink::DdsLink(DdsLink&&) noexcept = default;
DdsLink& DdsLink::operator=(DdsLink&& other) noexcept {
  std::swap(state_, other.state_);
  return *this;
}
DdsLink::~DdsLink() {
  if (state_) ::unlink(state_->path.c_str());
}

void DdsLink::publish(Topic topic, std::span<const std::byte> payload) {
  const auto key = payload_key(topic, payload);
  if (!key || payload.size() > kMaxPayloadBytes) {
    ++state_->counters.refused;
    return;
  }
  if (traits(topic).kind == TopicTraits::Kind::Durable) {
    state_->durable.keep(topic, key->bytes, payload);
    state_->send_durable();
  } else if (!state_->send_now({FrameKind::Publish, topic, payload})) {
    ++state_->counters.dropped_live;
  }
}

void DdsLink::beat(WallTime now) {
  if (now - state_->last_beat < kBeatPeriod) return;
  // A beat that does not fit is not queued: abbe-dds has not read for a while and will judge for itself.
  if (state_->send_now({FrameKind::Beat, {}, {}})) state_->last_beat = now;
}

void DdsLink::poll() {
  state_->accept_newest();
  if (state_->peer) state_->notice_departure();
  state_->send_durable();
  state_->send_waiting();
}

bool DdsLink::connected() const noexcept {
  return static_cast<bool>(state_->peer);
}

const DdsLinkCounters& DdsLink::counters() const noexcept {
  return state_->counters;
}

}  // namespace abbe::daemon
