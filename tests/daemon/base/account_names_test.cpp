/// Names of users and groups where the name service is slow, hangs, or does not know them.

#include "abbe/base/account_names.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <future>
#include <memory>
#include <string>
#include <thread>

#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;

/// A name service that answers when the test lets it, and counts the questions. Shared: the threads
/// of look-ups may outlive the test.
struct SlowService {
  std::promise<void> answers;
  std::shared_future<void> answered{answers.get_future()};
  std::atomic<int> asked{0};
};

class AccountNamesTest : public ::testing::Test {
 protected:
  AccountNamesTest() {
    test::write_text(folder_.path() / "passwd",
                     "root:x:0:0:root:/root:/bin/sh\nanna:x:1004:1004::/home/anna:/bin/sh\n");
    std::string members;
    for (int i = 0; i < 5000; ++i) members += "member" + std::to_string(i) + ",";
    test::write_text(folder_.path() / "group",
                     "many:x:99:" + members + "anna\nabbe-move:x:1007:anna\n");
  }
  [[nodiscard]] AccountNamesOptions options() const {
    AccountNamesOptions o{.users = folder_.path() / "passwd", .groups = folder_.path() / "group"};
    o.user_service = [s = service_](uid_t uid) -> std::optional<std::string> {
      ++s->asked;
      s->answered.wait();
      return "ldap" + std::to_string(uid);
    };
    o.group_service = [s = service_](const std::string& name) -> std::optional<gid_t> {
      ++s->asked;
      s->answered.wait();
      return name == "ldap-group" ? std::optional<gid_t>{4242} : std::nullopt;
    };
    return o;
  }

  TemporaryFolder folder_;
  std::shared_ptr<SlowService> service_ = std::make_shared<SlowService>();
};

TEST_F(AccountNamesTest, TheLocalFilesNeedNoNameService) {
  AccountNames names{options()};
  EXPECT_EQ(names.user(1004), "anna");
  EXPECT_EQ(names.group("abbe-move"), std::optional<gid_t>{1007}) << "behind a very long line";
  EXPECT_EQ(service_->asked, 0);
}

TEST_F(AccountNamesTest, ANameServiceThatHangsKeepsNobodyWaiting) {
  AccountNames names{options()};
  for (int i = 0; i < 1000; ++i) {
    ASSERT_EQ(names.user(2000), "uid 2000");
    ASSERT_EQ(names.group("ldap-group"), std::nullopt);
  }
  EXPECT_LE(service_->asked, 2) << "each is asked once";

  service_->answers.set_value();
  while (names.user(2000) != "ldap2000") std::this_thread::yield();
  while (names.group("ldap-group") != std::optional<gid_t>{4242}) std::this_thread::yield();
}

TEST_F(AccountNamesTest, AHangingServiceHoldsFewThreads) {
  AccountNames names{options()};
  for (uid_t uid = 2000; uid < 2100; ++uid)
    ASSERT_EQ(names.user(uid), "uid " + std::to_string(uid));
  EXPECT_LE(service_->asked, static_cast<int>(options().most_look_ups));
  service_->answers.set_value();
  while (names.user(2099) != "ldap2099") std::this_thread::yield();
}

TEST_F(AccountNamesTest, AnAnswerIsKeptWhileItIsAskedForAgain) {
  auto o = options();
  o.fresh = 0ms;
  AccountNames names{o};
  service_->answers.set_value();
  while (names.user(2000) != "ldap2000") std::this_thread::yield();
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(names.user(2000), "ldap2000");
}

TEST_F(AccountNamesTest, TheStartWaitsForGroupsForALimitedTime) {
  AccountNames names{options()};
  const std::array<std::string, 3> groups{"abbe-move", "", "ldap-group"};
  names.look_up(groups, 1ms);  // hangs: returns all the same
  EXPECT_EQ(names.group("ldap-group"), std::nullopt);
  service_->answers.set_value();
  names.look_up(groups, 60s);
  EXPECT_EQ(names.group("ldap-group"), std::optional<gid_t>{4242});
}

TEST_F(AccountNamesTest, AGroupThatIsAddedIsFound) {
  auto o = options();
  o.fresh = 0ms;
  AccountNames names{o};
  service_->answers.set_value();
  EXPECT_EQ(names.group("abbe-change"), std::nullopt);
  test::write_text(folder_.path() / "group", "abbe-change:x:1009:\n");
  while (names.group("abbe-change") != std::optional<gid_t>{1009}) std::this_thread::yield();
}

}  // namespace
}  // namespace abbe::daemon
