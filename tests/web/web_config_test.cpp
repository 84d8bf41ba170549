/// The table [web].

#include <gmock/gmock.h>

#include "web_folder.hpp"

namespace abbe::web {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct WebConfigTest : test::WebFolder {
  [[nodiscard]] std::vector<std::string> faults_of(const std::string& web) const {
    write_config(web);
    const auto read = settings();
    return read ? std::vector<std::string>{} : read.error().details;
  }
};

TEST_F(WebConfigTest, ListensOnThisComputerOnlyByDefault) {
  const auto read = settings();
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_EQ(read->web.address, "127.0.0.1");
  EXPECT_FALSE(read->web.tls());
  EXPECT_TRUE(read->web.users.empty());
}

TEST_F(WebConfigTest, AnAddressOfTheNetworkNeedsACertificate) {
  EXPECT_THAT(faults_of("address = \"0.0.0.0\"\n"),
              ElementsAre(AllOf(HasSubstr("web.address"), HasSubstr("certificate and key"))));
  EXPECT_THAT(faults_of("address = \"::\"\n"), ElementsAre(HasSubstr("web.address")));
  EXPECT_THAT(faults_of("address = \"0.0.0.0\"\ncertificate = \"a\"\nkey = \"b\"\n"),
              ElementsAre());
  EXPECT_THAT(faults_of("address = \"::1\"\n"), ElementsAre());
}

TEST_F(WebConfigTest, AnIdleUserIsLoggedOutAfterTheMinutesOfTheFile) {
  using namespace std::chrono_literals;
  EXPECT_EQ(settings()->web.session_idle, 30min);
  write_config("session_idle_min = 5\n");
  EXPECT_EQ(settings()->web.session_idle, 5min);
}

TEST_F(WebConfigTest, ReportsAllFaults) {
  EXPECT_THAT(
      faults_of("address = \"press3\"\nport = 70000\nkey = \"k\"\nlive_hz = 0\npasword = 1\n"),
      ElementsAre(HasSubstr("numeric address"), HasSubstr("web.port"), HasSubstr("needed together"),
                  HasSubstr("web.live_hz"), HasSubstr("web.pasword")));
}

}  // namespace
}  // namespace abbe::web
