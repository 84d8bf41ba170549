#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <thread>

#include "abbe/daemon/dds_link.hpp"
#include "shop_floor.hpp"

namespace abbe::test {
namespace {

struct AbbeDds : ShopFloor {
  int exit_code(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), ABBE_DDS_PROGRAM);
    return Process(std::move(arguments)).wait_for_end();
  }
  /// An abbed.toml whose sockets are in the folder of the test.
  void write_config(const std::string& supervise) {
    std::string text = "[machine]\nname = \"mill\"\nchain = \"[w b X Y Z t]\"\n";
    for (const char axis : {'X', 'Y', 'Z'})
      text += fmt::format("[axes.{}]\nmin_mm = 0\nmax_mm = 100\n", axis);
    text += fmt::format("[dds]\nsupervise = \"{}\"\ndomain = {}\nprofile = \"{}\"\nsocket = \"dds.sock\"\n",
                        supervise, domain_.text(), ABBE_LOOPBACK_PROFILE);
    std::ofstream(config) << text;
  }
  std::string socket = directory_ / "dds.sock";
  std::string config = directory_ / "abbed.toml";
};

TEST_F(AbbeDds, MissingProfileEndsWithThree) {
  EXPECT_EQ(exit_code({"--socket", socket, "--profile", directory_ / "missing.xml"}), 3);
}

TEST_F(AbbeDds, ProfileThatIsNoProfileEndsWithThree) {
  std::ofstream(directory_ / "bad.xml") << "<nonsense/>";
  EXPECT_EQ(exit_code({"--socket", socket, "--profile", directory_ / "bad.xml"}), 3);
}

TEST_F(AbbeDds, DomainWithoutPortsEndsWithTwo) {
  EXPECT_EQ(exit_code({"--socket", socket, "--domain", "233"}), 2);
}

// Fast DDS would make a participant that nobody hears, also when the network has come.
TEST_F(AbbeDds, WithoutAnInterfaceOfItsProfileItEndsWithFour) {
  std::stringstream text;
  text << std::ifstream(ABBE_LOOPBACK_PROFILE).rdbuf();
  std::string profile = text.str();
  const std::string named = "<interfaceWhiteList><address>127.0.0.1<";
  ASSERT_NE(profile.find(named), std::string::npos);
  profile.replace(profile.find(named), named.size(), "<interfaceWhiteList><address>203.0.113.1<");
  std::ofstream(directory_ / "absent.xml") << profile;
  EXPECT_EQ(exit_code({"--socket", socket, "--domain", domain_.text(), "--profile", directory_ / "absent.xml",
                       "--parent", "1"}),
            4);
}

TEST_F(AbbeDds, AsAServiceItRefusesAConfigurationThatMakesItAChild) {
  write_config("child");
  EXPECT_EQ(exit_code({"--config", config}), 3);
}

TEST_F(AbbeDds, AsAServiceItFindsSocketDomainAndProfileInTheConfiguration) {
  write_config("systemd");
  auto link = daemon::DdsLink::listen(socket);
  ASSERT_TRUE(link) << link.error().text;
  const Process service({ABBE_DDS_PROGRAM, "--config", config});
  const auto deadline = Clock::now() + std::chrono::seconds{20};
  while (!link->connected() && Clock::now() < deadline) {
    link->poll();
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  EXPECT_TRUE(link->connected());
}

TEST_F(AbbeDds, WithoutSocketAndConfigurationItIsUsage) {
  EXPECT_EQ(exit_code({}), 2);
}

TEST_F(AbbeDds, LeavesWhenItsParentIsSomebodyElse) {
  EXPECT_EQ(exit_code({"--socket", socket, "--domain", domain_.text(), "--profile", ABBE_LOOPBACK_PROFILE,
                       "--parent", "1"}),
            0);
}

TEST_F(AbbeDds, HelpListsTheExitCodes) {
  Process help({ABBE_DDS_PROGRAM, "--help"});
  EXPECT_EQ(help.wait_for_end(), 0);
  EXPECT_NE(help.transcript().find("Exit codes: 0 stopped"), std::string::npos);
}

}  // namespace
}  // namespace abbe::test
