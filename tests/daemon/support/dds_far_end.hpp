#pragma once
/// The other end of abbed's socket to abbe-dds, as a test holds it.

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <chrono>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "abbe/messages/cdr.hpp"
#include "abbe/messages/topics.hpp"

namespace abbe::daemon::test {

/// The far end: what abbe-dds would see, frame by frame.
struct FarEnd {
  struct Seen {
    int kind = -1;
    int topic = -1;
    std::chrono::nanoseconds at{};  ///< of CLOCK_MONOTONIC
    std::vector<std::byte> payload;
  };

  explicit FarEnd(const std::filesystem::path& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.string().copy(address.sun_path, sizeof(address.sun_path) - 1);
    EXPECT_EQ(::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  }
  ~FarEnd() { ::close(fd); }
  FarEnd(const FarEnd&) = delete;
  FarEnd& operator=(const FarEnd&) = delete;

  /// What abbe-dds sends when it sees another publisher of this machine.
  void report_twin(const std::string& text) const {
    std::string report{'\1', static_cast<char>(text.size()), '\0'};
    report += text;
    EXPECT_EQ(::send(fd, report.data(), report.size(), 0), static_cast<ssize_t>(report.size()));
  }

  /// Every whole frame that has arrived by now.
  std::vector<Seen> take() {
    std::byte chunk[4096];
    for (ssize_t n = 0; (n = ::recv(fd, chunk, sizeof(chunk), MSG_DONTWAIT)) > 0;) {
      bytes.insert(bytes.end(), chunk, chunk + n);
    }

    std::vector<Seen> seen;
    for (;;) {
      if (bytes.size() < 16) return seen;
      const std::size_t length = std::to_integer<std::size_t>(bytes[0]) |
                                 std::to_integer<std::size_t>(bytes[1]) << 8 |
                                 std::to_integer<std::size_t>(bytes[2]) << 16;
      if (bytes.size() < 16 + length) return seen;
      std::int64_t at_ns = 0;
      std::memcpy(&at_ns, &bytes[8], sizeof(at_ns));
      seen.push_back({std::to_integer<int>(bytes[4]),
                      std::to_integer<int>(bytes[5]),
                      std::chrono::nanoseconds{at_ns},
                      {}});
      const auto end = bytes.begin() + 16 + static_cast<std::ptrdiff_t>(length);
      seen.back().payload.assign(bytes.begin() + 16, end);
      bytes.erase(bytes.begin(), end);
    }
  }

  int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  std::vector<std::byte> bytes;
};

/// The messages of one topic among frames that were taken, in order.
template <class T>
std::vector<T> messages(const std::vector<FarEnd::Seen>& seen, Topic topic) {
  std::vector<T> out;
  for (const auto& frame : seen) {
    if (frame.topic != static_cast<int>(topic) || frame.payload.empty()) continue;
    auto message = decode<T>(frame.payload);
    EXPECT_TRUE(message) << traits(topic).name;
    if (message) out.push_back(std::move(*message));
  }
  return out;
}

}  // namespace abbe::daemon::test
