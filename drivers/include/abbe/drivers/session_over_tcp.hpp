#pragma once
/// The part that is common to all devices with a session over one TCP connection. It carries out
/// the actions of the sans-I/O session, gives the session a tick at its deadline, reads bytes for
/// receive(), and passes the messages decoded by receive() to the session in the next cycle. One
/// device thread.
///
/// `Words` declares the types of the session: Session, Input, Action, Open, Send, Close, Connected,
/// ConnectionLost; Message, the variant that receive() posts; and the capacity of one cycle: kInbox
/// messages and kMostRead bytes.
/// `Driver` derives from this class and defines: std::span<const std::byte> encode(const Send&),
/// which records the bytes and whose result is valid until its next call; void connected(), called
/// before the session gets Connected; void disconnected(), called before the socket is closed;
/// RawRing& raw().

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <variant>

#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/drivers/tcp_client.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::drivers {

struct TcpPeer {
  std::string name;  ///< name in messages: "tracker 10.0.0.7:700"
  std::string host;
  std::uint16_t port = 0;
};
[[nodiscard]] TcpPeer tcp_peer(const std::string& device, const std::string& host,
                               std::uint16_t port);
/// Error BadConfiguration: host or port is missing.
[[nodiscard]] Result<void> check(const TcpPeer& peer);

template <class Driver, class Words>
class SessionOverTcp {
 protected:
  using Input = typename Words::Input;
  using Message = typename Words::Message;

  SessionOverTcp(TcpPeer peer, const TimeSource& time, typename Words::Session session)
      : peer_(std::move(peer)), time_(time), session_(std::move(session)) {
    tcp_.look_up(peer_.host, peer_.port);
  }
  ~SessionOverTcp() = default;

  /// Passes the messages posted by receive() to the session, in order. Once the connection is
  /// closed, the remaining ones are discarded.
  void handle_posted_messages() {
    for (std::size_t i = 0; i < inbox_count_; ++i) {
      board_.set_connected(tcp_.established());
      std::visit([this](const auto& m) { handle(m); }, inbox_[i]);
    }
    inbox_count_ = 0;
    if (std::exchange(inbox_lost_, 0) != 0) {
      board_.fault(time_.now(), peer_.name +
                                    ": one read contained more messages than the inbox "
                                    "holds; the rest was discarded");
    }
  }

  /// Discards the messages posted by receive(), after one of them caused an internal error.
  void discard_posted_messages() noexcept { inbox_count_ = 0; }

  /// Passes an input to the session and carries out the resulting action. If the action fails at
  /// once, the failure is the next input.
  void handle(const Input& input) {
    Input next = input;
    while (act(session_.on(next, time_.now()), next)) {
    }
  }

  /// A time-out is evaluated only after all bytes in the socket have been read: when the thread was
  /// delayed, its deadline has passed although the answer is already in the socket. True: bytes
  /// were read, or the connection was established; receive() must handle that first. For a peer
  /// that sends continuously the time-out is evaluated after kMostLateReads reads.
  [[nodiscard]] bool reads_before_due() {
    const bool overdue = !tcp_.closed() && session_.deadline() <= time_.now();
    late_reads_ = overdue && late_reads_ < kMostLateReads && take_ready(std::chrono::nanoseconds{0})
                      ? late_reads_ + 1
                      : 0;
    return late_reads_ != 0;
  }

  /// Waits for bytes until the session's deadline, at most `at_most`, and reads them for
  /// received().
  void poll(std::chrono::nanoseconds at_most) {
    const auto until_due = session_.deadline() - time_.now();
    static_cast<void>(
        take_ready(time_.wall(std::clamp(until_due, std::chrono::nanoseconds{0}, at_most))));
  }

  [[nodiscard]] int descriptor() const noexcept { return tcp_.descriptor(); }
  [[nodiscard]] const typename Words::Session& session() const { return session_; }
  [[nodiscard]] typename Words::Session& session() { return session_; }

  void show() {
    board_.set_state(name_of(session_.state()));
    if (faults_seen_ == session_.fault().count) return;
    faults_seen_ = session_.fault().count;
    board_.fault(time_.now(), session_.fault().text);
  }

  /// Passes the last input to the session, sends what it requests, and does not wait for an answer.
  void leave(const Input& last) {
    handle(last);
    tcp_.finish();
  }

  /// Real time: the bytes read in this cycle; empty on a second call.
  [[nodiscard]] std::span<const std::byte> received() ABBE_RT {
    return std::span<const std::byte>{buffer_}.first(std::exchange(filled_, 0));
  }
  /// Real time: stores a message for the session; it is handled in the next cycle.
  void post(const Message& message) ABBE_RT {
    if (inbox_count_ < Words::kInbox) {
      inbox_[inbox_count_++] = message;
    } else {
      ++inbox_lost_;
    }
  }
  /// Real time: the message posted last in this cycle, or nullptr.
  [[nodiscard]] Message* last_posted() ABBE_RT {
    return inbox_count_ == 0 ? nullptr : &inbox_[inbox_count_ - 1];
  }

  TcpPeer peer_;
  const TimeSource& time_;
  StatusBoard board_;
  protocol::HostTime arrival_{};  ///< arrival of received(), or time of the connection

 private:
  /// This many reads of kMostRead = 64 kB are 8 MB: more than the kernel buffers by default for one
  /// connection.
  static constexpr std::size_t kMostLateReads = 128;

  /// Waits at most `wall` until the connection is established, has bytes, or is lost, and handles
  /// this event. False: none of them happened.
  [[nodiscard]] bool take_ready(std::chrono::nanoseconds wall) {
    const auto ready = tcp_.wait(wall);
    if (!ready) {
      lose(ready.error().text);
    } else if (*ready == TcpClient::Ready::Established) {
      arrival_ = time_.now();
      driver().connected();
      handle(typename Words::Connected{});
    } else if (*ready == TcpClient::Ready::Readable) {
      read();
    } else {
      return false;
    }

    return true;
  }

  [[nodiscard]] Driver& driver() { return static_cast<Driver&>(*this); }

  [[nodiscard]] bool act(const typename Words::Action& action, Input& next) {
    if (std::holds_alternative<typename Words::Open>(action)) {
      const auto opened = tcp_.open();
      if (!opened) next = typename Words::ConnectionLost{opened.error().text};
      return !opened;
    }

    if (const auto* command = std::get_if<typename Words::Send>(&action)) {
      const auto sent = tcp_.write(driver().encode(*command));
      if (sent) return false;
      record_loss();
      close();
      next = typename Words::ConnectionLost{sent.error().text};
      return true;
    }

    if (std::holds_alternative<typename Words::Close>(action)) close();
    return false;
  }

  void read() {
    const auto count = tcp_.read(buffer_);
    arrival_ = time_.now();
    if (!count) return lose(count.error().text);
    filled_ = *count;
  }

  /// Records that the peer or the network ended an established connection: an empty block ToDevice.
  void record_loss() {
    if (tcp_.established())
      driver().raw().push_bytes(time_.now(), protocol::RawBlock::Direction::ToDevice, {});
  }

  void lose(const std::string& why) {
    record_loss();
    close();
    handle(typename Words::ConnectionLost{why});
  }

  void close() {
    driver().disconnected();  // first: the descriptor is not used again after close()
    tcp_.close();
    inbox_count_ = 0;
    filled_ = 0;
    board_.set_connected(false);
  }

  typename Words::Session session_;
  TcpClient tcp_;
  std::uint64_t faults_seen_ = 0;
  std::size_t filled_ = 0;
  std::size_t late_reads_ = 0;  ///< consecutive reads after the deadline
  std::array<std::byte, Words::kMostRead> buffer_{};
  /// passed from receive() to the next wait(), same thread
  std::array<Message, Words::kInbox> inbox_{};
  std::size_t inbox_count_ = 0;
  std::uint64_t inbox_lost_ = 0;
};

}  // namespace abbe::drivers
