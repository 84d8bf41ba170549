// The conformance suite on the smallest driver there is: 16-byte records over TCP. Shows how a
// driver's test is written, and that the suite can be passed.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/status_board.hpp"
#include "driver_conformance.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::DeviceStatus;
using protocol::HostTime;
using protocol::ProbeTrigger;
using protocol::SampleFlag;

struct Record {
  std::uint32_t magic = 0x45424241;
  std::uint32_t number = 0;
  std::int64_t host_ns = 0;
};

class Fd {
 public:
  Fd() = default;
  explicit Fd(int fd) : fd_(fd) {}
  Fd(Fd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Fd& operator=(Fd&& other) noexcept {
    std::swap(fd_, other.fd_);
    other.reset();
    return *this;
  }
  ~Fd() { reset(); }
  void reset() {
    if (fd_ >= 0) ::close(std::exchange(fd_, -1));
  }
  [[nodiscard]] int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }

 private:
  int fd_ = -1;
};

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in a{};
  a.sin_family = AF_INET;
  a.sin_port = htons(port);
  a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return a;
}
const sockaddr* as_sockaddr(const sockaddr_in& a) {
  return reinterpret_cast<const sockaddr*>(&a);
}

class RecordDevice final : public drivers::Device {
 public:
  static constexpr auto kSilence = 500ms;

  RecordDevice(const SteppedTime& time, std::uint16_t port) : time_(time), port_(port) {}

  void wait(std::chrono::nanoseconds) override {
    if (!socket_) connect_to_peer();
    if (!socket_) return;
    const ssize_t n =
        ::recv(socket_.get(), buffer_.data() + filled_, buffer_.size() - filled_, MSG_DONTWAIT);

    if (n > 0) {
      last_heard_ = time_.now();
      board_.set_connected(true);
      board_.set_state("streaming");
      raw_.push_bytes(
          last_heard_, protocol::RawBlock::Direction::FromDevice,
          std::as_bytes(std::span(buffer_)).subspan(filled_, static_cast<std::size_t>(n)));
      filled_ += static_cast<std::size_t>(n);
    } else if (n == 0) {
      lose("record device: connection closed by the peer");
    } else if (time_.now() - last_heard_ > kSilence) {
      lose("record device: silent for 500 ms");
    }

    if (malformed_) lose("record device: bytes that are no record");
  }

  void receive() ABBE_RT override {
    std::size_t used = 0;
    for (; filled_ - used >= sizeof(Record) && !malformed_; used += sizeof(Record)) {
      Record r;
      std::memcpy(&r, buffer_.data() + used, sizeof r);
      malformed_ = r.magic != Record{}.magic;
      if (!malformed_) push(r);
    }
    std::memmove(buffer_.data(), buffer_.data() + used, filled_ - used);
    filled_ -= used;
  }

  [[nodiscard]] DeviceStatus status() const override {
    return board_.read("record device", ring_.dropped(), raw_.dropped());
  }
  drivers::SampleRing<ProbeTrigger>& ring() { return ring_; }

 private:
  void connect_to_peer() {
    Fd s(::socket(AF_INET, SOCK_STREAM, 0));
    const auto address = loopback(port_);
    if (::connect(s.get(), as_sockaddr(address), sizeof address) != 0) return;
    socket_ = std::move(s);
    last_heard_ = time_.now();
  }
  void lose(const char* cause) {
    board_.fault(time_.now(), cause);
    board_.set_connected(false);
    board_.set_state("closed");
    socket_.reset();
    filled_ = 0;
    malformed_ = false;
    interrupted_ = true;
  }
  void push(const Record& r) ABBE_RT {
    ProbeTrigger t;
    t.head.time = HostTime{std::chrono::nanoseconds{r.host_ns}};
    if (std::exchange(interrupted_, false)) t.head.flags |= SampleFlag::Restarted;
    t.touch = r.number;
    board_.samples.add();
    ring_.try_push(t);
  }

  const SteppedTime& time_;
  std::uint16_t port_;
  Fd socket_;
  drivers::StatusBoard board_;
  drivers::SampleRing<ProbeTrigger> ring_{64};
  drivers::RawRing raw_{64};
  std::array<char, 8192> buffer_{};
  std::size_t filled_ = 0;
  bool malformed_ = false;
  bool interrupted_ = false;
  HostTime last_heard_{};
};

class RecordPeer {
 public:
  static constexpr std::chrono::nanoseconds kCycle = 10ms;
  static constexpr std::chrono::nanoseconds kSilenceLimit = RecordDevice::kSilence;
  static constexpr std::chrono::nanoseconds kRecoveryLimit = 1s;
  static constexpr bool kTornCanBeFinished = true;

  static std::set<std::string_view> shown(Fault fault) {
    if (fault == Fault::None) return {"streaming"};
    return {"closed"};
  }

  RecordPeer()
      : port_holder_(bound_socket(0)), port_(port_of(port_holder_.get())), device_(time_, port_) {
    plug_in();
  }

  drivers::Device& device() { return device_; }
  SteppedTime& time() { return time_; }
  void take_samples(std::vector<protocol::SampleHead>& heads) {
    std::array<ProbeTrigger, 100> out{};
    const std::size_t n = device_.ring().pop(out);
    for (std::size_t i = 0; i < n; ++i) heads.push_back(out[i].head);
  }
  void serve() {
    if (Fd accepted(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK)); accepted) {
      connection_ = std::move(accepted);
    }
  }
  void send_valid() { say(1); }
  void hold_back() { holding_ = true; }
  void send_held() {
    holding_ = false;
    send(held_.data(), held_.size());
    held_.clear();
  }
  void send_torn() {
    torn_ = Record{.number = ++number_, .host_ns = time_.now().time_since_epoch().count()};
    send(&torn_, 7);
  }
  void finish_torn() { send(reinterpret_cast<const char*>(&torn_) + 7, sizeof torn_ - 7); }
  void send_garbage() { send("no record of any kind", 21); }
  void unplug() {
    connection_.reset();
    listener_.reset();
  }
  void plug_in() {
    listener_ = bound_socket(port_);
    ASSERT_EQ(::listen(listener_.get(), 4), 0);
  }
  void flood() { say(200); }
  void restart() {
    connection_.reset();
    number_ = 0;
  }

 private:
  static Fd bound_socket(std::uint16_t port) {
    Fd s(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0));
    const int yes = 1;
    ::setsockopt(s.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    ::setsockopt(s.get(), SOL_SOCKET, SO_REUSEPORT, &yes, sizeof yes);
    const auto address = loopback(port);
    EXPECT_EQ(::bind(s.get(), as_sockaddr(address), sizeof address), 0);
    return s;
  }
  static std::uint16_t port_of(int fd) {
    sockaddr_in a{};
    socklen_t size = sizeof a;
    ::getsockname(fd, reinterpret_cast<sockaddr*>(&a), &size);
    return ntohs(a.sin_port);
  }
  void say(int records) {
    std::vector<char> bytes;
    for (int i = 0; i < records; ++i) {
      const Record r{.number = ++number_, .host_ns = time_.now().time_since_epoch().count()};
      const auto* p = reinterpret_cast<const char*>(&r);
      bytes.insert(bytes.end(), p, p + sizeof r);
    }
    if (holding_) {
      held_.insert(held_.end(), bytes.begin(), bytes.end());
    } else {
      send(bytes.data(), bytes.size());
    }
  }
  void send(const void* bytes, std::size_t n) {
    if (connection_) ::send(connection_.get(), bytes, n, MSG_NOSIGNAL);
  }

  SteppedTime time_;
  Fd port_holder_;
  std::uint16_t port_;
  Fd listener_;
  Fd connection_;
  std::uint32_t number_ = 0;
  Record torn_;
  bool holding_ = false;
  std::vector<char> held_;
  RecordDevice device_;
};

INSTANTIATE_TYPED_TEST_SUITE_P(SmallestDriver, DriverConformance, RecordPeer);

}  // namespace
}  // namespace abbe::tests
