#pragma once
/// Simulated devices behind TCP in a thread of their own, above everything that is measured, which
/// keeps when they wrote what their client has not taken yet.

#include <gtest/gtest.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <optional>
#include <thread>
#include <vector>

#include "abbe/sim/ippdme_server.hpp"
#include "abbe/sim/sim_clock.hpp"
#include "abbe/sim/simulation.hpp"

namespace abbe::tests {

class ServedDevices {
 public:
  /// What a simulated device or a stage of them offers.
  struct Peer {
    std::function<void(std::vector<pollfd>&)> add_poll_fds;
    std::function<protocol::HostTime()> next_due;
    std::function<void(protocol::HostTime)> poll;
  };

  ServedDevices(Peer peer, int priority) : peer_(std::move(peer)) {
    thread_ = std::thread([this, priority] {
      const sched_param param{.sched_priority = priority};
      EXPECT_EQ(pthread_setschedparam(pthread_self(), SCHED_FIFO, &param), 0);
      while (!stop_) serve();
    });
  }
  ~ServedDevices() {
    stop_ = true;
    thread_.join();
  }
  ServedDevices(const ServedDevices&) = delete;
  ServedDevices& operator=(const ServedDevices&) = delete;

  /// When the oldest bytes were written since the last call.
  std::optional<protocol::HostTime> take_written() {
    const auto at = written_.exchange(0, std::memory_order_relaxed);
    if (at == 0) return std::nullopt;
    return protocol::HostTime{std::chrono::nanoseconds{at}};
  }

 private:
  void serve() {
    constexpr std::chrono::nanoseconds kLongest = std::chrono::milliseconds{20};
    std::vector<pollfd> fds;
    peer_.add_poll_fds(fds);
    const auto wait =
        std::clamp(peer_.next_due() - clock_.now(), std::chrono::nanoseconds{0}, kLongest);
    const timespec timeout{0, static_cast<long>(wait.count())};
    ::ppoll(fds.data(), fds.size(), &timeout, nullptr);
    const auto before = sent(fds);
    peer_.poll(clock_.now());
    if (sent(fds) == before) return;

    // On the one processor of the guest no thread of lower priority has run since the write.
    std::int64_t none = 0;
    written_.compare_exchange_strong(none, clock_.now().time_since_epoch().count(),
                                     std::memory_order_relaxed);
  }
  static std::uint64_t sent(const std::vector<pollfd>& fds) {
    std::uint64_t bytes = 0;
    for (const auto& fd : fds) {
      tcp_info info{};
      socklen_t size = sizeof info;
      if (::getsockopt(fd.fd, IPPROTO_TCP, TCP_INFO, &info, &size) == 0)
        bytes += info.tcpi_bytes_sent;
    }
    return bytes;
  }

  Peer peer_;
  sim::SimClock clock_{1.0};
  std::atomic<std::int64_t> written_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

inline ServedDevices::Peer peer_of(sim::Simulation& simulation) {
  return {[&](auto& fds) { simulation.add_poll_fds(fds); }, [&] { return simulation.next_due(); },
          [&](protocol::HostTime now) { simulation.poll(now); }};
}
inline ServedDevices::Peer peer_of(sim::IppDmeServer& server) {
  return {[&](auto& fds) {
            fds.push_back({server.listener_fd(), POLLIN, 0});
            if (server.client_fd() >= 0) fds.push_back({server.client_fd(), POLLIN, 0});
          },
          [&] { return server.next_due(); }, [&](protocol::HostTime now) { server.poll(now); }};
}
inline sim::IppDmeServer open_measuring_machine(protocol::HostTime now) {
  return sim::IppDmeServer::open(0, std::make_unique<sim::IppDmeDevice>(sim::IppDmeOptions{}, now))
      .value();
}

}  // namespace abbe::tests
