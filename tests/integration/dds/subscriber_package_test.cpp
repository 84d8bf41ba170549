// The package for subscribers, and the arguments of its examples.
#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "shop_floor.hpp"

namespace abbe::test {
namespace {

/// Builds the examples with nothing but the files that the package installs, for both compilers of
/// types.
class SubscriberPackage : public ShopFloor {
 protected:
  void SetUp() override {
    const std::filesystem::path log = directory_ / "build.log";
    const std::string command = ABBE_BUILD_EXAMPLES " >" + log.string() + " 2>&1";
    if (std::system(command.c_str()) != 0) {
      std::system(("cat " + log.string()).c_str());
      FAIL() << "the examples do not build";
    }
  }
  static std::string example(const char* name) {
    return ABBE_PACKAGED_EXAMPLES "/" + std::string(name);
  }
};

TEST_F(SubscriberPackage, ItsExamplesBuildFromItAloneAndApply) {
  start_feeder();
  Process fast({example("fastdds_subscriber"), domain_.text(), ABBE_LOOPBACK_PROFILE});
  Process cyclone({example("cyclone_subscriber"), domain_.text()});
  EXPECT_TRUE(fast.wait_for("vmc-3: apply V")) << fast.transcript();
  EXPECT_TRUE(cyclone.wait_for("vmc-3: apply V")) << cyclone.transcript();
}

struct Ended {
  int exit_code;
  std::string text;  ///< of both streams
};

Ended end_of(const std::vector<std::string>& command) {
  std::vector<std::string> shell{"/bin/sh", "-c", "exec \"$@\" 2>&1", "sh"};
  shell.insert(shell.end(), command.begin(), command.end());
  Process process(shell);
  const int exit_code = process.wait_for_end();
  return {exit_code, process.transcript()};
}

TEST(SubscriberExamples, RefuseADomainThatIsNone) {
  for (const char* program : {ABBE_FAST_SUBSCRIBER, ABBE_CYCLONE_SUBSCRIBER}) {
    for (const char* domain : {"mill", "-1", "233", "7x", "", "99999999999999999999"}) {
      const Ended ended = end_of({program, domain});
      EXPECT_EQ(ended.exit_code, 2) << program << ' ' << domain;
      EXPECT_THAT(ended.text, testing::HasSubstr("DOMAIN is not a number from 0 to 232"));
    }
    EXPECT_EQ(end_of({program}).exit_code, 2);
  }
}

TEST(SubscriberExamples, RefuseAProfileThatCannotBeRead) {
  const Ended missing = end_of({ABBE_FAST_SUBSCRIBER, "0", "/nonexistent/profiles.xml"});
  EXPECT_EQ(missing.exit_code, 3);
  EXPECT_THAT(missing.text,
              testing::HasSubstr("\"abbe\" can be read from /nonexistent/profiles.xml"));
}

TEST(SubscriberExamples, RefuseKeysThatAreMissing) {
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{ABBE_FAST_SUBSCRIBER, "0", ABBE_LOOPBACK_PROFILE, "/nonexistent"},
        {ABBE_CYCLONE_SUBSCRIBER, "0", "/nonexistent"}}) {
    const Ended ended = end_of(command);
    EXPECT_EQ(ended.exit_code, 4) << ended.text;
    EXPECT_THAT(ended.text, testing::HasSubstr("cannot join domain 0"));
  }
}

}  // namespace
}  // namespace abbe::test
