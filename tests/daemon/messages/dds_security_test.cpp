#include "abbe/messages/dds_security.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <fstream>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

class DdsSecurity : public testing::Test {
 protected:
  DdsSecurity() {
    std::string name = testing::TempDir() + "abbe-keys-XXXXXX";
    root_ = ::mkdtemp(name.data());
    keys_ = root_ / "keys";
  }
  ~DdsSecurity() override { fs::remove_all(root_); }

  void make(int subscribers = 2) {
    const auto made = make_dds_keys({.folder = keys_, .subscribers = subscribers}, now_);
    ASSERT_TRUE(made) << made.error().text;
  }
  [[nodiscard]] static mode_t mode_of(const fs::path& file) {
    struct stat status {};
    EXPECT_EQ(::stat(file.c_str(), &status), 0) << file;
    return status.st_mode & 0777;
  }

  const std::chrono::system_clock::time_point now_ = std::chrono::system_clock::now();
  fs::path root_;
  fs::path keys_;
};

TEST_F(DdsSecurity, PrivateKeysAreReadableByTheirOwnerOnly) {
  make();
  for (const char* key :
       {"ca.key", "daemon/identity.key", "subscriber-1/identity.key", "subscriber-2/identity.key"})
    EXPECT_EQ(mode_of(keys_ / key), 0600u) << key;
}

TEST_F(DdsSecurity, NothingIsOverwritten) {
  make();
  const auto again = make_dds_keys({.folder = keys_}, now_);
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, ErrorCode::Refused);
  EXPECT_THAT(again.error().text, testing::HasSubstr("nothing is overwritten"));
}

TEST_F(DdsSecurity, EachRoleFindsItsIdentityInTheFolder) {
  make();
  const auto daemon = find_dds_identity(keys_, DdsRole::Daemon, now_);
  const auto subscriber = find_dds_identity(keys_, DdsRole::Subscriber, now_);
  const auto second = find_dds_identity(keys_ / "subscriber-2", DdsRole::Subscriber, now_);
  ASSERT_TRUE(daemon && subscriber && second);
  EXPECT_EQ(daemon->folder, keys_ / "daemon");
  EXPECT_EQ(subscriber->folder, keys_ / "subscriber-1");
  EXPECT_EQ(second->folder, keys_ / "subscriber-2");
}

TEST_F(DdsSecurity, AMissingFileIsNamed) {
  make();
  fs::remove(keys_ / "daemon/governance.p7s");
  const auto found = find_dds_identity(keys_, DdsRole::Daemon, now_);
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().text, testing::AllOf(testing::HasSubstr("daemon/governance.p7s"),
                                                 testing::HasSubstr("abbe dds keys")));
}

TEST_F(DdsSecurity, AWorldReadableKeyIsRefused) {
  make();
  ASSERT_EQ(::chmod((keys_ / "daemon/identity.key").c_str(), 0644), 0);
  const auto found = find_dds_identity(keys_, DdsRole::Daemon, now_);
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().text, testing::HasSubstr("chmod 600"));
}

TEST_F(DdsSecurity, AnExpiredIdentityIsRefusedWithItsDates) {
  make();
  const auto found = find_dds_identity(keys_, DdsRole::Daemon, now_ + std::chrono::days{3651});
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().text, testing::HasSubstr("make new keys"));
}

/// The profile of a site: `inside` is in <rtps> of the participant profile of that name.
std::string profile_text(const std::string& inside, const std::string& name = "abbe") {
  return R"(<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><profiles>)"
         "<participant profile_name=\"" +
         name + "\"><rtps>" + inside + "</rtps></participant></profiles></dds>";
}

std::string properties(const std::vector<std::string>& names) {
  std::string text = "<propertiesPolicy><properties>";
  for (const auto& name : names)
    text += "<property><name>" + name + "</name><value>x</value></property>";
  return text + "</properties></propertiesPolicy>";
}

const std::string kOwn = properties({"dds.sec.auth.plugin", "dds.sec.access.plugin"});

TEST_F(DdsSecurity, AProfileOfTheSiteMayHaveItsOwnSecurityProperties) {
  const fs::path profile = root_ / "dds.xml";
  std::ofstream(profile) << profile_text(kOwn);
  EXPECT_TRUE(dds_is_secured({}, profile));
  EXPECT_TRUE(dds_is_secured(keys_, {}));
  EXPECT_FALSE(dds_is_secured({}, {}));
  EXPECT_FALSE(dds_is_secured({}, root_ / "absent.xml"));
  // Without <dds> around it, as Fast DDS allows.
  const std::string text = profile_text(kOwn);
  const auto begin = text.find("<profiles>");
  std::ofstream(profile) << text.substr(begin, text.rfind("</dds>") - begin);
  EXPECT_TRUE(dds_is_secured({}, profile));
}

TEST_F(DdsSecurity, OnlyTheParticipantProfileThatIsUsedCounts) {
  const fs::path profile = root_ / "dds.xml";
  for (const std::string& text : {
           profile_text("<!-- " + kOwn + " -->"),                // a comment
           profile_text(kOwn, "robot"),                          // another participant
           profile_text("<name>dds.sec.access.plugin</name>"),   // no property
           profile_text(properties({"dds.sec.access.plugin"})),  // no authentication
           profile_text(properties({"dds.sec.auth.plugin"})),    // no access
           std::string{"<dds><profiles><participant profile_name=\"abbe\">"},  // cut off
           "<!-- dds.sec.auth.plugin dds.sec.access.plugin -->" + profile_text(""),
           std::string{"<!-- nothing else -->"},
           std::string{},
       }) {
    std::ofstream(profile) << text;
    EXPECT_FALSE(dds_is_secured({}, profile)) << text;
  }
}

}  // namespace
}  // namespace abbe::daemon
