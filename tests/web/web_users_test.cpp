/// Users, passwords and sessions.

#include <gmock/gmock.h>

#include <vector>

#include "abbe/web/sessions.hpp"
#include "web_folder.hpp"

namespace abbe::web {
namespace {

using namespace std::chrono_literals;
using test::kPassword;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

struct WebUsersTest : test::WebFolder {
  WebUsersTest() { write_users(); }
  [[nodiscard]] std::filesystem::path users() const { return folder_ / "users"; }
  Sessions::Clock::time_point now_ = Sessions::Clock::now();
};

TEST_F(WebUsersTest, APasswordIsFoundInTheFileAndAnotherOneIsNot) {
  const auto read = read_web_users(users());
  ASSERT_TRUE(read);
  EXPECT_THAT(*read, SizeIs(3));
  const auto found = find_web_user(*read, "calibrate", kPassword);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->role, WebRole::Calibrate);
  EXPECT_FALSE(find_web_user(*read, "calibrate", kPassword + "!"));
  EXPECT_FALSE(find_web_user(*read, "nobody", kPassword));
}

TEST_F(WebUsersTest, TheFileDoesNotContainThePassword) {
  const auto line = web_user_line("anna", WebRole::View, kPassword);
  ASSERT_TRUE(line);
  EXPECT_THAT(*line, AllOf(HasSubstr("anna:view:$y$"), ::testing::Not(HasSubstr(kPassword))));
  EXPECT_NE(*line, web_user_line("anna", WebRole::View, kPassword).value());  // another salt
}

TEST_F(WebUsersTest, NamesAndShortPasswordsAreRefused) {
  EXPECT_FALSE(web_user_line("an:na", WebRole::View, kPassword));
  EXPECT_FALSE(web_user_line("", WebRole::View, kPassword));
  EXPECT_FALSE(web_user_line("anna", WebRole::View, "short"));
}

TEST_F(WebUsersTest, FaultyLinesAreNamed) {
  write("users", "# comment\nanna:boss:$y$j9T$x$y\nbert:view:secret\ncarl\n");
  const auto read = read_web_users(users());
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().details,
              ElementsAre(HasSubstr("users:2:"), HasSubstr("users:3:"), HasSubstr("users:4:")));
}

TEST_F(WebUsersTest, AFileThatOthersMayReadIsRefused) {
  ::chmod(users().c_str(), 0644);
  const auto read = read_web_users(users());
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().text, HasSubstr("chmod 0640"));
}

TEST_F(WebUsersTest, ASessionEndsWhenItIsIdleTooLongOrLoggedOut) {
  Sessions sessions(users(), {.idle = 60s});
  const auto session = sessions.log_in("view", kPassword, "::1", now_);
  ASSERT_TRUE(session);
  EXPECT_TRUE(sessions.find(session->token, now_ + 59s));
  EXPECT_TRUE(sessions.find(session->token, now_ + 118s));
  EXPECT_FALSE(sessions.find(session->token, now_ + 178s));
  const auto again = sessions.log_in("view", kPassword, "::1", now_);
  sessions.log_out(again->token);
  EXPECT_FALSE(sessions.find(again->token, now_));
}

TEST_F(WebUsersTest, ASessionEndsWhenItsUserIsRemoved) {
  Sessions sessions(users());
  const auto session = sessions.log_in("view", kPassword, "::1", now_);
  ASSERT_TRUE(sessions.find(session->token, now_));
  write("users", "# nobody\n");
  EXPECT_FALSE(sessions.find(session->token, now_));
}

TEST_F(WebUsersTest, ASessionEndsWhenItsPasswordIsChanged) {
  Sessions sessions(users());
  const auto session = sessions.log_in("view", kPassword, "::1", now_);
  ASSERT_TRUE(sessions.find(session->token, now_));
  write("users", web_user_line("view", WebRole::View, "another long password").value() + "\n");
  EXPECT_FALSE(sessions.find(session->token, now_));
}

TEST_F(WebUsersTest, AFaultInTheFileIsReportedWithItsLineAndTheUsersStay) {
  std::vector<std::string> log;
  Sessions sessions(users(), {}, [&log](const std::string& line) { log.push_back(line); });
  const auto session = sessions.log_in("view", kPassword, "::1", now_);
  ASSERT_TRUE(session);
  const std::string good = text_of("users");
  write("users", "anna:view\n" + good);
  EXPECT_TRUE(sessions.find(session->token, now_));
  EXPECT_TRUE(sessions.log_in("calibrate", kPassword, "::1", now_));
  ASSERT_THAT(log, SizeIs(1));
  EXPECT_THAT(log[0], AllOf(HasSubstr("users:1: must be NAME:ROLE:HASH"),
                            HasSubstr("the users of the last good file stay")));
  write("users", good);
  EXPECT_TRUE(sessions.find(session->token, now_));
  ASSERT_THAT(log, SizeIs(2));
  EXPECT_THAT(log[1], HasSubstr("can be used again"));
}

TEST_F(WebUsersTest, AFaultThatIsThereAtTheStartIsReportedAndNobodyCanLogIn) {
  write("users", "anna:view\n");
  std::vector<std::string> log;
  Sessions sessions(users(), {}, [&log](const std::string& line) { log.push_back(line); });
  EXPECT_THAT(log, ElementsAre(HasSubstr("users:1: must be NAME:ROLE:HASH")));
  EXPECT_FALSE(sessions.log_in("view", kPassword, "::1", now_));
}

TEST_F(WebUsersTest, TheOldestOfTooManySessionsOfAUserEnds) {
  Sessions sessions(users(), {.of_one_user = 2});
  const auto other = sessions.log_in("administer", kPassword, "::1", now_);
  std::vector<std::string> tokens;
  for (const auto later : {1s, 2s, 3s})
    tokens.push_back(sessions.log_in("view", kPassword, "::1", now_ + later)->token);
  EXPECT_FALSE(sessions.find(tokens[0], now_ + 3s));
  EXPECT_TRUE(sessions.find(tokens[1], now_ + 3s));
  EXPECT_TRUE(sessions.find(tokens[2], now_ + 3s));
  EXPECT_TRUE(sessions.find(other->token, now_ + 3s));
}

TEST_F(WebUsersTest, ALookIsNoUseOfASession) {
  Sessions sessions(users(), {.idle = 60s});
  const auto session = sessions.log_in("view", kPassword, "::1", now_);
  EXPECT_TRUE(sessions.find(session->token, now_ + 59s, SessionUse::Look));
  EXPECT_FALSE(sessions.find(session->token, now_ + 61s));
}

TEST_F(WebUsersTest, AfterTooManyWrongPasswordsTheAddressWaits) {
  Sessions sessions(users(), {.failures = 2, .pause = 60s});
  for (int i = 0; i < 2; ++i) EXPECT_FALSE(sessions.log_in("view", "wrong", "10.0.0.1", now_));
  const auto refused = sessions.log_in("view", kPassword, "10.0.0.1", now_);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("wait 60 s"));
  EXPECT_TRUE(sessions.log_in("view", kPassword, "10.0.0.2", now_));
  EXPECT_TRUE(sessions.log_in("view", kPassword, "10.0.0.1", now_ + 61s));
}

TEST_F(WebUsersTest, WithoutAFileNobodyCanLogIn) {
  Sessions sessions({});
  EXPECT_FALSE(sessions.possible());
  EXPECT_FALSE(sessions.log_in("view", kPassword, "::1", now_));
}

}  // namespace
}  // namespace abbe::web
