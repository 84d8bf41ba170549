// A network that comes up after the start, on a link between two network namespaces. Needs root and
// ip(8).

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "figure.hpp"
#include "shop_floor.hpp"

namespace abbe::test {
namespace {

bool run(const std::string& command) {
  return std::system((command + " 2>/dev/null").c_str()) == 0;
}

/// Two network namespaces and a link between them, removed after the test.
class TwoHosts {
 public:
  TwoHosts() {
    made_ =
        run("ip netns add " + here) && run("ip netns add " + there) &&
        run("ip link add name abbe0 netns " + here + " type veth peer name abbe0 netns " + there);
    for (const auto& host : {here, there})
      made_ = made_ && run("ip -n " + host + " link set lo up");
  }
  ~TwoHosts() {
    for (const auto& host : {here, there}) run("ip netns del " + host);
  }
  TwoHosts(const TwoHosts&) = delete;
  TwoHosts& operator=(const TwoHosts&) = delete;

  [[nodiscard]] bool made() const { return made_; }
  static bool give_address(const std::string& host, const std::string& address) {
    return run("ip -n " + host + " addr add " + address + "/24 dev abbe0");
  }
  /// Both ends; waits until the kernel has noticed the carrier, as Fast DDS uses no interface
  /// before.
  [[nodiscard]] bool plug_in() const {
    for (const auto& host : {here, there})
      if (!run("ip -n " + host + " link set abbe0 up")) return false;
    for (int i = 0; i < 100; ++i, ::usleep(100'000))
      if (!without_carrier(here) && !without_carrier(there)) return true;
    return false;
  }
  /// `command` on `host`.
  static std::vector<std::string> on(const std::string& host, std::vector<std::string> command) {
    std::vector<std::string> all{"/usr/bin/env", "ip", "netns", "exec", host};
    all.insert(all.end(), command.begin(), command.end());
    return all;
  }

  const std::string here = "abbe-here-" + std::to_string(::getpid());
  const std::string there = "abbe-there-" + std::to_string(::getpid());

 private:
  static bool without_carrier(const std::string& host) {
    return run("ip -n " + host + " link show abbe0 | grep -q NO-CARRIER");
  }

  bool made_ = false;
};

struct LateNetwork : ShopFloor {
  void SetUp() override {
    if (!hosts.made())
      GTEST_SKIP() << "no network namespaces: root, ip(8) and a kernel that allows them are needed";
    ASSERT_TRUE(hosts.give_address(hosts.there, "10.213.7.2"));
    ASSERT_TRUE(hosts.plug_in());
  }
  void TearDown() override { feeder_.reset(); }

  void start_publisher(const std::vector<std::string>& more) {
    const std::string socket = directory_ / "dds.sock";
    std::vector<std::string> command{ABBE_FEEDER_PROGRAM, socket, kMachine,   ABBE_DDS_PROGRAM,
                                     "--socket",          socket, "--domain", domain_.text()};
    command.insert(command.end(), more.begin(), more.end());
    feeder_ = std::make_unique<Process>(hosts.on(hosts.here, std::move(command)));
    ASSERT_TRUE(feeder_->wait_for("child")) << feeder_->transcript();
  }
  /// As on a machine's network: no profile of the loopback.
  [[nodiscard]] std::unique_ptr<Process> fast(const std::string& host) const {
    return std::make_unique<Process>(hosts.on(host, {ABBE_FAST_SUBSCRIBER, domain_.text()}));
  }
  [[nodiscard]] std::unique_ptr<Process> cyclone(const std::string& host) const {
    return std::make_unique<Process>(
        hosts.on(host, {"env", "-u", "CYCLONEDDS_URI", ABBE_CYCLONE_SUBSCRIBER, domain_.text()}));
  }
  long starts() {
    const auto lines = feeder_->lines();
    return std::ranges::count_if(lines,
                                 [](const Line& line) { return line.text.starts_with("child "); });
  }

  /// Between two vectors that it applied, one after the other.
  static double longest_gap_s(Process& subscriber) {
    std::chrono::duration<double> longest{0};
    std::optional<Clock::time_point> before;
    for (const Line& line : subscriber.lines()) {
      if (line.text.find("vmc-3: apply V") == std::string::npos) continue;
      if (before) longest = std::max<std::chrono::duration<double>>(longest, line.came - *before);
      before = line.came;
    }
    return longest.count();
  }

  TwoHosts hosts;
};

// Fast DDS keeps the addresses of its start.
TEST_F(LateNetwork, AnAddressThatCameAfterTheStartIsUsed) {
  start_publisher({});
  const auto beside = fast(hosts.here);
  const auto far_fast = fast(hosts.there);
  const auto far_cyclone = cyclone(hosts.there);

  ASSERT_TRUE(beside->wait_for("vmc-3: apply V")) << beside->transcript();
  ASSERT_TRUE(hosts.give_address(hosts.here, "10.213.7.1"));
  for (Process* far : {far_fast.get(), far_cyclone.get()})
    EXPECT_TRUE(far->wait_for("vmc-3: apply V", {}, std::chrono::seconds{30})) << far->transcript();
  EXPECT_TRUE(beside->wait_for("vmc-3: apply V", Clock::now()))
      << "the first subscriber receives again";
  tests::print_figure("abbe-dds uses a new address: gap of a subscriber that was there", "-",
                      "{:.2f} s", longest_gap_s(*beside));
  EXPECT_EQ(starts(), 1) << "abbe-dds executes itself in the same process";
}

TEST_F(LateNetwork, AnAddressThatTheProfileDoesNotAllowChangesNothing) {
  start_publisher({"--profile", ABBE_LOOPBACK_PROFILE});
  const auto beside = std::make_unique<Process>(hosts.on(hosts.here, fast_subscriber()));
  ASSERT_TRUE(beside->wait_for("vmc-3: apply V")) << beside->transcript();
  ASSERT_TRUE(hosts.give_address(hosts.here, "10.213.7.1"));
  // Another participant would be another publisher; it comes within 6 s.
  EXPECT_FALSE(beside->wait_for("vmc-3: publisher is", Clock::now(), std::chrono::seconds{8}))
      << beside->transcript();
}

}  // namespace
}  // namespace abbe::test
