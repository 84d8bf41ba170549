#include "abbe/messages/dds_link.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include "abbe/base/unix_socket.hpp"
#include "abbe/result/try.hpp"
#include "dds_frames.hpp"
#include "retained_payloads.hpp"

namespace abbe::daemon {
namespace {

/// Limits the duration of a hub cycle when processes connect again and again.
constexpr int kAcceptsPerCycle = 4;

struct Pending {
  bool to_send = true;
};

bool may_connect(int fd, const DdsLinkPeer& peer) {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  if (::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &credentials, &size) != 0) return false;
  const DdsProcess* const process = peer.process;
  if (process == nullptr) return credentials.uid == (peer.user ? peer.user->uid : ::geteuid());
  // A process of another PID namespace has the pid 0. This must not match: pid() also returns 0
  // while no abbe-dds runs.
  return credentials.pid != 0 && credentials.pid == process->pid();
}

/// Lets the group of `user` open the socket. If the folder has the setgid bit, the socket has this
/// group already, and chown() is not needed (abbed.service does not permit it). The Error has the
/// code Io, because a restart succeeds after a person has corrected the folder.
Result<void> open_to_group(const std::filesystem::path& socket,
                           const std::optional<Account>& user) {
  if (!user) return {};
  struct stat status {};
  if (::stat(socket.c_str(), &status) == 0 && status.st_gid == user->gid) return {};
  if (::chown(socket.c_str(), static_cast<uid_t>(-1), user->gid) == 0) return {};
  return fail(
      ErrorCode::Io,
      fmt::format("{}: its group cannot be set to that of abbe-dds: {}: set [dds] socket to "
                  "a file in /run/abbe-dds, or give its folder to this group with the mode "
                  "2750 (systemd-tmpfiles --create)",
                  socket.string(), std::strerror(errno)));
}

/// Tracks the unanswered beats of one connection.
class Beats {
 public:
  void ask(DdsLink::WallTime now) {
    // After a pause of the hub, or of all of abbed, the silence of abbe-dds is counted from this
    // beat, because no answers were read during the pause.
    if (!unanswered_since_ || now - asked_ > DdsProcess::kPause) unanswered_since_ = now;
    asked_ = now;
  }
  void answered() { unanswered_since_.reset(); }
  [[nodiscard]] std::chrono::nanoseconds silence() const {
    return unanswered_since_ ? asked_ - *unanswered_since_ : std::chrono::nanoseconds{0};
  }

 private:
  std::optional<DdsLink::WallTime> unanswered_since_;
  DdsLink::WallTime asked_{};
};

}  // namespace

struct DdsLink::State {
  std::filesystem::path path;
  FileDescriptor listener;
  DdsLinkPeer allowed;
  DdsProcess* process = nullptr;
  FileDescriptor peer;
  std::vector<std::byte> out;  ///< bytes not sent yet: at most the rest of one frame
  std::size_t out_begin = 0;
  RetainedPayloads<Pending> durable;
  /// Live samples that wait because the socket is full, with the times to which their ages refer.
  RetainedPayloads<WallTime> live;
  WallTime last_beat{};
  Beats beats;
  AnswerReader answers;
  DdsLinkCounters counters;

  void accept_newest();
  void read_answers();
  void disconnect();
  bool send_waiting();
  bool send_now(const Frame& frame);
  bool send_durable();
  void send_live();
  void send_or_keep(const Frame& frame, const PayloadKey& key);
};

/// Accepts connections of abbe-dds. A new one replaces the old one, whose process hangs or was
/// replaced by the supervisor.
void DdsLink::State::accept_newest() {
  for (int i = 0; i < kAcceptsPerCycle; ++i) {
    FileDescriptor accepted(
        ::accept4(listener.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!accepted) return;
    if (!may_connect(accepted.get(), allowed)) {
      ++counters.foreign_connections;
      continue;
    }

    disconnect();
    peer = std::move(accepted);
    ++counters.connections;
    beats = {};
    answers = {};
    last_beat = {};  // the next beat is sent at once
    for (auto& entry : durable.entries()) entry.extra.to_send = true;
  }
}

/// Reads the answers to beats, and the reports of twins.
void DdsLink::State::read_answers() {
  std::array<std::byte, 512> bytes{};
  const ssize_t n = ::recv(peer.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (n > 0) beats.answered();
  if (n > 0) answers.take(std::span(bytes).first(static_cast<std::size_t>(n)));
  if (n > 0 && process != nullptr) process->answered(WallTime::clock::now());
  if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) disconnect();
}

void DdsLink::State::disconnect() {
  peer = FileDescriptor{};
  out.clear();
  out_begin = 0;
  counters.dropped_live += live.entries().size();
  live.entries().clear();
}

/// Sends the waiting bytes. True if the next frame can be sent.
bool DdsLink::State::send_waiting() {
  while (peer && out_begin < out.size()) {
    const ssize_t n = ::send(peer.get(), out.data() + out_begin, out.size() - out_begin,
                             MSG_DONTWAIT | MSG_NOSIGNAL);
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

/// Queues `frame` if all earlier frames have been handed to the kernel, and sends as much as fits.
/// False if the socket is full or disconnected; `frame` is then not sent.
bool DdsLink::State::send_now(const Frame& frame) {
  if (!send_waiting()) return false;
  append_frame(out, frame);
  send_waiting();
  return static_cast<bool>(peer);
}

/// Sends the waiting durable samples. True if none waits any more.
bool DdsLink::State::send_durable() {
  for (auto& entry : durable.entries()) {
    if (!entry.extra.to_send) continue;
    if (!send_now({FrameKind::Publish, entry.topic, WallTime::clock::now(), entry.payload}))
      return false;
    entry.extra.to_send = false;
  }
  return true;
}

void DdsLink::State::send_live() {
  auto& waiting = live.entries();
  auto next = waiting.begin();
  while (next != waiting.end() &&
         send_now({FrameKind::Publish, next->topic, next->extra, next->payload}))
    ++next;
  // otherwise disconnect() has removed them already
  if (peer) waiting.erase(waiting.begin(), next);
}

/// Sends a live sample. While the socket is full the sample waits, and replaces a waiting one of
/// the same key.
void DdsLink::State::send_or_keep(const Frame& frame, const PayloadKey& key) {
  if (live.entries().empty() && send_now(frame)) return;
  if (!peer) {
    ++counters.dropped_live;
    return;
  }
  const std::size_t waiting = live.entries().size();
  live.keep(frame.topic, key.bytes, frame.payload).extra = frame.at;
  if (live.entries().size() == waiting) ++counters.dropped_live;
  send_live();
}

Result<DdsLink> DdsLink::listen(const std::filesystem::path& socket, DdsLinkPeer peer) {
  auto listener = listen_unix(socket);
  ABBE_TRY(listener);
  ABBE_TRY(open_to_group(socket, peer.user));
  auto state = std::make_unique<State>();
  state->allowed = peer;
  state->path = socket;
  state->listener = std::move(*listener);
  state->process = peer.process;
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

void DdsLink::publish(Topic topic, std::span<const std::byte> payload, WallTime at) {
  const auto key = payload_key(topic, payload);
  if (!key || payload.size() > kMaxPayloadBytes) {
    ++state_->counters.refused;
    return;
  }
  if (traits(topic).kind == TopicTraits::Kind::Durable) {
    state_->durable.keep(topic, key->bytes, payload);
    state_->send_durable();
  } else {
    state_->send_or_keep({FrameKind::Publish, topic, at, payload}, *key);
  }
}

void DdsLink::beat(WallTime now) {
  if (now - state_->last_beat < kBeatPeriod) return;
  state_->beats.ask(now);
  if (state_->process != nullptr) state_->process->asked(now);
  // A beat is not queued when the socket is full: abbe-dds has not read for some time and detects
  // the silence itself. A beat is not sent before a waiting ModelState: abbe-dds would take abbed
  // for alive and repeat the previous ModelState.
  if (state_->send_durable() && state_->send_now({FrameKind::Beat, {}, now, {}}))
    state_->last_beat = now;
}

void DdsLink::poll() {
  state_->accept_newest();
  if (state_->peer) state_->read_answers();
  state_->send_durable();
  state_->send_live();
  state_->send_waiting();
}

bool DdsLink::connected() const noexcept {
  return static_cast<bool>(state_->peer);
}

bool DdsLink::answers() const noexcept {
  return connected() && state_->beats.silence() <= kUnanswered;
}

const std::string& DdsLink::twin() const noexcept {
  return state_->answers.twin();
}

const char* DdsLink::state() const noexcept {
  if (!connected()) return "waiting";
  return answers() ? "connected" : "does not answer";
}

const DdsProcess* DdsLink::process() const noexcept {
  return state_->process;
}

const DdsLinkCounters& DdsLink::counters() const noexcept {
  return state_->counters;
}

}  // namespace abbe::daemon
