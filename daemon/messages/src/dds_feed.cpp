#include <poll.h>
#include <sys/socket.h>

#include <cerrno>
#include <string>
#include <utility>

#include "abbe/base/unix_socket.hpp"
#include "abbe/messages/dds_bridge.hpp"
#include "dds_frames.hpp"

namespace abbe::daemon {

struct DdsFeed::State {
  State(std::filesystem::path s, DdsBridge& b) : socket(std::move(s)), bridge(b) {}

  std::filesystem::path socket;
  DdsBridge& bridge;
  FileDescriptor peer;
  FrameReader frames;
  std::string reported_twin;

  void connect() {
    auto fd = connect_unix(socket);
    if (!fd) return;
    peer = std::move(*fd);
    frames = FrameReader();
    bridge.connected();
    reported_twin.clear();
  }

  void disconnect() {
    peer = FileDescriptor();
    bridge.lost();
  }

  /// Reads all bytes that wait in the socket, because the latest state of abbed is at their end.
  void read() {
    constexpr int kMostReads = 64;  // together more than the socket buffer holds
    for (int i = 0; i < kMostReads && read_once(); ++i) {
    }
  }

  /// True if more bytes may be waiting.
  bool read_once() {
    const auto room = frames.room();
    const ssize_t n = ::recv(peer.get(), room.data(), room.size(), MSG_DONTWAIT);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return false;
    if (n > 0) frames.filled(static_cast<std::size_t>(n));
    feed();
    if (n > 0 && !frames.broken()) return static_cast<std::size_t>(n) == room.size();
    disconnect();
    return false;
  }

  /// Answers a beat, so that abbed knows that this loop runs. If the socket is full the answer is
  /// lost; abbed then does not read, so nothing more is lost.
  void answer() const {
    const std::byte alive{};
    static_cast<void>(::send(peer.get(), &alive, 1, MSG_DONTWAIT | MSG_NOSIGNAL));
  }

  /// Sends the report of a twin. If the socket is full, the next cycle tries again. The report is
  /// never sent in part, because it is short and abbed reads at once.
  void report(const std::string& twin) {
    if (!peer || twin == reported_twin) return;
    const auto bytes = twin_report(twin);
    const ssize_t n = ::send(peer.get(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (n == static_cast<ssize_t>(bytes.size())) reported_twin = twin;
  }

  void feed() {
    while (const auto frame = frames.next()) {
      const auto now = std::chrono::steady_clock::now();
      if (frame->kind == FrameKind::Beat) {
        bridge.beat(frame->at, now);
        answer();
      } else {
        bridge.publish(frame->topic, frame->payload, frame->at, now);
      }
    }
  }
};

DdsFeed::DdsFeed(std::filesystem::path socket, DdsBridge& bridge)
    : state_(std::make_unique<State>(std::move(socket), bridge)) {}
DdsFeed::~DdsFeed() = default;

void DdsFeed::cycle() {
  State& s = *state_;
  if (!s.peer) s.connect();
  // Without a connection the descriptor is -1: poll() ignores it and only waits.
  pollfd ready{s.peer.get(), POLLIN, 0};
  if (::poll(&ready, 1, static_cast<int>(kRetryPeriod.count())) > 0) s.read();
  s.bridge.cycle(std::chrono::steady_clock::now());
}

void DdsFeed::report_twin(const std::string& seen) {
  state_->report(seen);
}

bool DdsFeed::connected() const noexcept {
  return static_cast<bool>(state_->peer);
}

}  // namespace abbe::daemon
