#include <gtest/gtest.h>

#include <fstream>

#include "shop_floor.hpp"

namespace abbe::test {
namespace {

struct AbbeDds : ShopFloor {
  int exit_code(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), ABBE_DDS_PROGRAM);
    return Process(std::move(arguments)).wait_for_end();
  }
  std::string socket = directory_ / "dds.sock";
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
