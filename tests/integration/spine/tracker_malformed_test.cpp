/// Something that is no tracker answers at the tracker's port.

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string_view>
#include <thread>

#include "spine.hpp"

namespace abbe::test {
namespace {

using testing::HasSubstr;

/// Behaves like a web server: every connection is answered at once and then closed.
class WebServer {
 public:
  WebServer()
      : listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)),
        stop_(::eventfd(0, EFD_CLOEXEC)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    auto* generic = reinterpret_cast<sockaddr*>(&address);  // the socket API's own idiom
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(listener_, generic, size), 0);
    EXPECT_EQ(::listen(listener_, 8), 0);
    EXPECT_EQ(::getsockname(listener_, generic, &size), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { serve(); });
  }
  ~WebServer() {
    ::eventfd_write(stop_, 1);
    thread_.join();
    ::close(listener_);
    ::close(stop_);
  }
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  void serve() const {
    constexpr std::string_view kAnswer = "HTTP/1.1 400 Bad Request\r\n\r\n";
    for (;;) {
      std::array<pollfd, 2> waits{{{listener_, POLLIN, 0}, {stop_, POLLIN, 0}}};
      ::poll(waits.data(), waits.size(), -1);
      if (waits[1].revents != 0) return;
      const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
      if (client < 0) continue;
      (void)::send(client, kAnswer.data(), kAnswer.size(), MSG_NOSIGNAL);
      ::shutdown(client, SHUT_WR);
      ::close(client);
    }
  }

  int listener_;
  int stop_;
  std::uint16_t port_ = 0;
  std::thread thread_;
};

TEST_F(Spine, TrackerThatSendsMalformedBytesIsNamedAndTheEncodersContinue) {
  const WebServer nonsense;
  write_path("path.csv", path());

  ASSERT_NO_FATAL_FAILURE(start_simulator());
  tracker_port_ = nonsense.port();
  write_configuration();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const auto fault = [this] { return stream("tracker").value("last_fault", std::string{}); };
  EXPECT_TRUE(eventually([&] { return fault().find("emScon") != std::string::npos; })) << fault();
  EXPECT_THAT(fault(), HasSubstr("127.0.0.1:" + std::to_string(nonsense.port())));
  EXPECT_THAT(fault(), HasSubstr("HTTP"));
  EXPECT_TRUE(goes_on("encoder"));
  const auto shown = run({ABBE_PROGRAM, "status", "-c", file("abbed.toml")});
  EXPECT_EQ(shown.code, 0);
  EXPECT_THAT(shown.out, HasSubstr("expected emScon answer"));
  EXPECT_EQ(abbed_->stop(), 0);
}

}  // namespace
}  // namespace abbe::test
