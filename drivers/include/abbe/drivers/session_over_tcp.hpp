#pragma once
/// What every device does alike that is a session over one TCP connection: the actions of the
/// sans-I/O session carried out, its ticks kept, bytes read for receive(), and what receive()
/// understood told to the session in the next turn. One device thread.
///
/// `Words` names the session's vocabulary: Session, Input, Action, Open, Send, Close, Connected,
/// ConnectionLost; Message, the variant that receive() posts; kInbox messages and kMostRead bytes
/// of room for one turn. `Driver` derives from this and gives: std::span<const std::byte>
/// encode(const Send&), valid until its next call and already recorded; void connected(), before
/// the session hears of it; void disconnected(); RawRing& raw().

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
  std::string name;  ///< how messages name it: "tracker 10.0.0.7:700"
  std::string host;
  std::uint16_t port = 0;
};
[[nodiscard]] TcpPeer tcp_peer(const std::string& device, const std::string& host,
                               std::uint16_t port);
/// BadConfiguration.
[[nodiscard]] Result<void> check(const TcpPeer& peer);

template <class Driver, class Words>
class SessionOverTcp {
 protected:
  using Input = typename Words::Input;
  using Message = typename Words::Message;

  SessionOverTcp(TcpPeer peer, const TimeSource& time, typename Words::Session session)
      : peer_(std::move(peer)), time_(time), session_(std::move(session)) {}
  ~SessionOverTcp() = default;

  /// What receive() understood, in order; the rest of it is void once the connection is closed.
  void read_mail() {
    for (std::size_t i = 0; i < inbox_count_; ++i) {
      board_.set_connected(tcp_.established());
      std::visit([this](const auto& m) { tell(m); }, inbox_[i]);
    }
    inbox_count_ = 0;
    if (std::exchange(inbox_lost_, 0) != 0) {
      board_.fault(time_.now(), peer_.name + ": more messages in one read than there is room for");
    }
  }

  /// An action may fail at once, which is the next input.
  void tell(const Input& input) {
    Input next = input;
    while (act(session_.on(next, time_.now()), next)) {
    }
  }

  /// A time-out is judged only when nothing is left to read of what came before it: a thread that
  /// was held up finds its deadlines passed and the answers in the socket. True: something was read
  /// (or connected), which receive() takes first. A peer that sends without end is judged after
  /// kMostLateReads.
  [[nodiscard]] bool reads_before_due() {
    const bool overdue = !tcp_.closed() && session_.deadline() <= time_.now();
    late_reads_ = overdue && late_reads_ < kMostLateReads && take_ready(std::chrono::nanoseconds{0})
                      ? late_reads_ + 1
                      : 0;
    return late_reads_ != 0;
  }

  /// Waits, and reads what came into received().
  void poll(std::chrono::nanoseconds at_most) {
    const auto until_due = session_.deadline() - time_.now();
    static_cast<void>(
        take_ready(time_.wall(std::clamp(until_due, std::chrono::nanoseconds{0}, at_most))));
  }

  [[nodiscard]] const typename Words::Session& session() const { return session_; }
  [[nodiscard]] typename Words::Session& session() { return session_; }

  void show() {
    board_.set_state(name_of(session_.state()));
    if (faults_seen_ == session_.fault().count) return;
    faults_seen_ = session_.fault().count;
    board_.fault(time_.now(), session_.fault().text);
  }

  /// Says goodbye without waiting for an answer.
  void leave(const Input& goodbye) {
    tell(goodbye);
    tcp_.finish();
  }

  /// Real time: the bytes of this turn, once.
  [[nodiscard]] std::span<const std::byte> received() ABBE_RT {
    return std::span<const std::byte>{buffer_}.first(std::exchange(filled_, 0));
  }
  /// Real time: for the session in the next turn.
  void post(const Message& message) ABBE_RT {
    if (inbox_count_ < Words::kInbox) {
      inbox_[inbox_count_++] = message;
    } else {
      ++inbox_lost_;
    }
  }
  /// Real time: the message posted last in this turn, or none.
  [[nodiscard]] Message* last_posted() ABBE_RT {
    return inbox_count_ == 0 ? nullptr : &inbox_[inbox_count_ - 1];
  }

  TcpPeer peer_;
  const TimeSource& time_;
  StatusBoard board_;
  protocol::HostTime arrival_{};  ///< of received(), or of the connection

 private:
  /// 8 MB: more than the kernel's default keeps for one connection.
  static constexpr std::size_t kMostLateReads = 128;

  /// False if nothing came in `wall`.
  [[nodiscard]] bool take_ready(std::chrono::nanoseconds wall) {
    const auto ready = tcp_.wait(wall);
    if (!ready) {
      lose(ready.error().text);
    } else if (*ready == TcpClient::Ready::Established) {
      arrival_ = time_.now();
      driver().connected();
      tell(typename Words::Connected{});
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
      const auto opened = tcp_.open(peer_.host, peer_.port);
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

  /// Not by us: nothing sent, into a connection that was there.
  void record_loss() {
    if (tcp_.established())
      driver().raw().push_bytes(time_.now(), protocol::RawBlock::Direction::ToDevice, {});
  }

  void lose(const std::string& why) {
    record_loss();
    close();
    tell(typename Words::ConnectionLost{why});
  }

  void close() {
    tcp_.close();
    inbox_count_ = 0;
    filled_ = 0;
    driver().disconnected();
    board_.set_connected(false);
  }

  typename Words::Session session_;
  TcpClient tcp_;
  std::uint64_t faults_seen_ = 0;
  std::size_t filled_ = 0;
  std::size_t late_reads_ = 0;  ///< in a row, after the deadline
  std::array<std::byte, Words::kMostRead> buffer_{};
  std::array<Message, Words::kInbox> inbox_{};  ///< from receive() to the next wait(), same thread
  std::size_t inbox_count_ = 0;
  std::uint64_t inbox_lost_ = 0;
};

}  // namespace abbe::drivers
