// More than a hundred participants on one computer.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <fstream>
#include <vector>

#include "abbe/base/file_descriptor.hpp"
#include "shop_floor.hpp"

namespace abbe::test {
namespace {

constexpr int kOthers = 120;

/// Binds the ports of a participant [DDSI-RTPS 2.5, 9.6.2.3].
std::vector<daemon::FileDescriptor> occupied(int domain, int participants) {
  std::vector<daemon::FileDescriptor> sockets;
  for (int port = 0; port < 2 * participants; ++port) {
    sockets.emplace_back(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_port = ::htons(static_cast<std::uint16_t>(7400 + 250 * domain + 10 + port));
    EXPECT_EQ(::bind(sockets.back().get(), reinterpret_cast<sockaddr*>(&own), sizeof own), 0)
        << "port of participant " << port / 2;
  }
  return sockets;
}

class DdsCrowd : public ShopFloor {
 protected:
  /// The loopback profile as a site may have written it before: peers up to participant 130, and no
  /// mutation_tries.
  DdsCrowd() : ShopFloor(2) {
    std::ifstream shipped{ABBE_LOOPBACK_PROFILE};
    std::string text{std::istreambuf_iterator<char>{shipped}, {}};
    const auto replace = [&text](const std::string& from, const std::string& to) {
      const auto at = text.find(from);
      ASSERT_NE(at, std::string::npos) << from;
      text.replace(at, from.size(), to);
    };
    replace("<maxInitialPeersRange>16<", "<maxInitialPeersRange>131<");
    replace("<mutation_tries>400</mutation_tries>", "");
    profile_ = directory_ / "crowd.xml";
    std::ofstream{profile_} << text;
  }
};

TEST_F(DdsCrowd, TheParticipantsBeyondTheFirstHundredAreFoundToo) {
  const auto others = occupied(std::stoi(domain_.text()), kOthers);
  start_feeder();
  Process watcher({ABBE_WATCH_PROGRAM, "--domain", domain_.text(), "--profile", profile_,
                   "--until-model", "--timeout-s", "30"});
  EXPECT_EQ(watcher.wait_for_end(std::chrono::seconds{40}), 0) << watcher.transcript();
  Process fast({ABBE_FAST_SUBSCRIBER, domain_.text(), profile_});
  EXPECT_TRUE(fast.wait_for("vmc-3: apply V")) << fast.transcript();
}

}  // namespace
}  // namespace abbe::test
