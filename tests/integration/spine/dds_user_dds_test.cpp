/// abbe-dds as a user of its own, as abbe-dds.service runs it: it has its link and nothing else.
/// The user is "nobody". Only root may start programs as another user.

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/unix_socket.hpp"
#include "spine.hpp"

namespace abbe::test {
namespace {

using testing::HasSubstr;

struct DdsUser : Spine {
  void SetUp() override {
    if (::geteuid() != 0) GTEST_SKIP() << "needs root, to start programs as another user";
    // As systemd-tmpfiles makes it: the socket gets the group of the folder.
    ASSERT_EQ(::chmod(directory_.c_str(), 0755), 0);
    ASSERT_EQ(::mkdir(file("run-dds").c_str(), 0750), 0);
    ASSERT_EQ(::chown(file("run-dds").c_str(), 0, kNobodysGroup), 0);
    ASSERT_EQ(::chmod(file("run-dds").c_str(), 02750), 0);
    write_configuration_of("[cmm]\nhost = \"127.0.0.1\"\nport = 1\n", "systemd");
    write("abbed.toml", replaced(text_of(file("abbed.toml")), "supervise = \"systemd\"\n",
                                 "user = \"nobody\"\n"));
    ASSERT_EQ(::chmod(file("abbed.toml").c_str(), 0600), 0) << "the unit passes it on";
    ASSERT_EQ(::mkdir(file("credentials").c_str(), 0755), 0);
    write("credentials/abbed.toml", text_of(file("abbed.toml")));
    abbed_ = start({"/bin/sh", "-c", "umask 027; exec \"$@\"", "sh", ABBED_PROGRAM, "--config",
                    file("abbed.toml"), "--dds-unit"},
                   "abbed");  // the umask of its unit
    ASSERT_TRUE(eventually([this] { return status().is_object() || !abbed_->running(); }));
    ASSERT_TRUE(abbed_->running()) << abbed_->err();
  }
  static std::vector<std::string> as_nobody(std::vector<std::string> command) {
    command.insert(command.begin(),
                   {"/usr/bin/setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"});
    return command;
  }
  void start_abbe_dds() {
    auto command = as_nobody({ABBE_BIN_DIR "/abbe-dds", "--config", file("abbed.toml")});
    command.insert(command.begin(),
                   {"/usr/bin/env", "CREDENTIALS_DIRECTORY=" + file("credentials")});
    abbe_dds_ = start(std::move(command), "abbe-dds");
  }
  [[nodiscard]] bool connected() {
    return eventually([this] {
             const auto now = status();
             return (now.is_object() && now["dds"]["connected"] == true) || !abbe_dds_->running();
           }) &&
           abbe_dds_->running();
  }

  static constexpr gid_t kNobodysGroup = 65534;
  std::unique_ptr<Program> abbe_dds_;
};

TEST_F(DdsUser, ConnectsAndAfterItsEndConnectsAgain) {
  start_abbe_dds();
  ASSERT_TRUE(connected()) << abbe_dds_->err();
  abbe_dds_->signal(SIGKILL);
  ASSERT_TRUE(eventually([this] { return status()["dds"]["connected"] == false; }));
  start_abbe_dds();
  EXPECT_TRUE(connected()) << abbe_dds_->err();
}

TEST_F(DdsUser, ReportsWhenAbbedEnds) {
  start_abbe_dds();
  ASSERT_TRUE(connected()) << abbe_dds_->err();
  ASSERT_TRUE(
      eventually([this] { return abbe_dds_->err().find("abbed is alive") != std::string::npos; }));
  abbed_->signal(SIGKILL);
  EXPECT_TRUE(eventually([this] {
    return abbe_dds_->err().find("ModelState INVALID is published") != std::string::npos;
  }));
  EXPECT_TRUE(abbe_dds_->running()) << "it waits for the next abbed";
}

TEST_F(DdsUser, TheLinkRefusesEveryOtherUser) {
  start_abbe_dds();
  ASSERT_TRUE(connected()) << abbe_dds_->err();
  // Root may open every socket; abbed runs as root here, too.
  const auto foreign = daemon::connect_unix(directory_ / "run-dds" / "dds.sock");
  ASSERT_TRUE(foreign) << foreign.error().text;
  EXPECT_TRUE(eventually([this] { return status()["dds"]["refused_connections"] == 1; }))
      << status()["dds"].dump();
  EXPECT_EQ(status()["dds"]["connected"], true);
}

TEST_F(DdsUser, CannotOpenTheControlSocketOrTheStore) {
  const auto asked = run(as_nobody({ABBE_PROGRAM, "status", "--socket", file("run/control.sock")}));
  EXPECT_NE(asked.code, 0);
  EXPECT_THAT(asked.err, HasSubstr("Permission denied"));
  EXPECT_NE(run(as_nobody({"/bin/sh", "-c", "ls '" + file("data") + "/models'"})).code, 0);
  EXPECT_NE(run(as_nobody({"/bin/sh", "-c", "touch '" + file("data") + "/stranger'"})).code, 0);
  EXPECT_NE(run(as_nobody({"/bin/cat", file("abbed.toml")})).code, 0);
}

TEST_F(DdsUser, HasNoRoleEvenWhereItCanOpenTheControlSocket) {
  ASSERT_EQ(::chmod(file("run").c_str(), 0755), 0);
  ASSERT_EQ(::chmod(file("run/control.sock").c_str(), 0666), 0);
  const auto asked = run(as_nobody({ABBE_PROGRAM, "status", "--socket", file("run/control.sock")}));
  EXPECT_EQ(asked.code, 5);
  EXPECT_THAT(asked.err, HasSubstr("nobody is the user of abbe-dds"));
}

TEST(DdsUnit, HasAUserOfItsOwnInNoGroupOfAbbe) {
  const auto unit = text_of(std::filesystem::path{ABBE_UNIT_DIR} / "abbe-dds.service");
  EXPECT_THAT(unit, HasSubstr("\nUser=abbe-dds\nGroup=abbe-dds\n"));
  EXPECT_THAT(unit, testing::Not(HasSubstr("\nSupplementaryGroups=")));
  const auto abbed = text_of(std::filesystem::path{ABBE_UNIT_DIR} / "abbed.service");
  EXPECT_THAT(abbed, HasSubstr(" --dds-unit\n"));
  EXPECT_THAT(abbed, HasSubstr("\nWants=network-online.target abbe-dds.service\n"));
  const auto users = text_of(std::filesystem::path{ABBE_UNIT_DIR} / "abbe.sysusers");
  EXPECT_THAT(users, HasSubstr("\nu abbe-dds "));
  EXPECT_THAT(users, testing::Not(HasSubstr("\nm abbe-dds ")));
}

}  // namespace
}  // namespace abbe::test
