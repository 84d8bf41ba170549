#include "abbe/config/notify_config.hpp"

#include <gmock/gmock.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <string>

#include "abbe/config/check_config.hpp"
#include "abbe/notify/receiver.hpp"

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;
namespace fs = std::filesystem;

class NotifyConfigTest : public ::testing::Test {
 protected:
  NotifyConfigTest() {
    std::string name = testing::TempDir() + "abbe-notify-XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~NotifyConfigTest() override { fs::remove_all(folder_); }

  static std::string example() {
    std::ifstream in{ABBE_EXAMPLE_CONFIG};
    return {std::istreambuf_iterator<char>{in}, {}};
  }
  Result<NotifySettings> load(const std::string& text) {
    std::ofstream{folder_ / "abbed.toml"} << text;
    return load_notify_settings(folder_ / "abbed.toml");
  }
  /// The example, then `tables`.
  Result<NotifySettings> load_with(const std::string& tables) {
    return load(example() + "\n" + tables);
  }
  void write_secret(const std::string& name, const std::string& text, fs::perms mode) {
    std::ofstream{folder_ / name} << text;
    fs::permissions(folder_ / name, mode);
  }
  std::vector<std::string> faults(const std::string& tables) {
    const auto settings = load_with(tables);
    EXPECT_FALSE(settings) << tables;
    return settings ? std::vector<std::string>{} : settings.error().details;
  }

  static constexpr fs::perms kPrivate = fs::perms::owner_read | fs::perms::owner_write;
  fs::path folder_;
};

TEST_F(NotifyConfigTest, ShowsTheDefaultsInTheExample) {
  const auto plain = load(example());
  ASSERT_TRUE(plain) << plain.error().text;
  const auto uncommented =
      load(std::regex_replace(example(), std::regex{"\n#([a-z_A-Z]+ = )"}, "\n$1"));
  ASSERT_TRUE(uncommented) << ::testing::PrintToString(uncommented.error().details);
  EXPECT_EQ(uncommented->notify.events, NotifyConfig{}.events);
  EXPECT_EQ(uncommented->notify.settle, NotifyConfig{}.settle);
  EXPECT_THAT(plain->notify.events, SizeIs(kNotifyKindNames.size()));
  EXPECT_EQ(plain->machine, "mill 7");
  EXPECT_FALSE(notify::receivers_of(plain->notify)) << "there is no receiver";
}

TEST_F(NotifyConfigTest, TakesAllKeys) {
  write_secret("token", "Bearer abc\n", kPrivate);
  write_secret("url", "https://hooks.example.com/secret\n", kPrivate | fs::perms::group_read);
  write_secret("password", "p\n", kPrivate);
  const auto settings = load_with(R"(
[[notify.webhook]]
url = "https://[2001:db8::1]:8443/hook?x=1"
header = "X-Token"
token_file = "token"
[[notify.webhook]]
url_file = "url"
[notify.mail]
server = "smtp://mail.example.com:587"
from = "abbe@example.com"
to = ["anna@example.com", "otto@example.com"]
user = "abbe"
password_file = "password"
)");
  ASSERT_TRUE(settings) << ::testing::PrintToString(settings.error().details);
  const auto receivers = notify::receivers_of(settings->notify);
  ASSERT_TRUE(receivers) << receivers.error().text;
  ASSERT_THAT(*receivers, SizeIs(4));
  EXPECT_EQ(std::get<notify::Webhook>((*receivers)[0].way).header, "X-Token: Bearer abc");
  EXPECT_EQ((*receivers)[1].name, "webhook 2 (https://hooks.example.com)") << "no secret";
  EXPECT_EQ(std::get<notify::Webhook>((*receivers)[1].way).url, "https://hooks.example.com/secret");
  EXPECT_EQ(std::get<notify::Mailbox>((*receivers)[3].way).recipient, "otto@example.com");
  EXPECT_EQ(std::get<notify::Mailbox>((*receivers)[3].way).password, "p");
}

TEST_F(NotifyConfigTest, RefusesAnEventThatDoesNotExistWithItsPlace) {
  const auto settings = load(std::regex_replace(example(), std::regex{"\n\\[notify\\]\n"},
                                                "\n[notify]\nevents = [\"drift\", \"rain\"]\n"));
  ASSERT_FALSE(settings);
  EXPECT_THAT(settings.error().details,
              ElementsAre(AllOf(HasSubstr("abbed.toml:"), HasSubstr("notify.events"),
                                HasSubstr("\"rain\""), HasSubstr("device_lost"))));
}

TEST_F(NotifyConfigTest, RefusesUrlsThatCannotBeUsed) {
  for (const char* url :
       {"ftp://example.com", "example.com", "https://", "https://a b", "https://u:p@example.com",
        "file:///etc/passwd", "https://example.com:0", "https://example.com:x", "https://exa%mple"})
    EXPECT_THAT(faults(std::string("[[notify.webhook]]\nurl = \"") + url + "\"\n"),
                ElementsAre(HasSubstr("notify.webhook[0].url")))
        << url;
}

TEST_F(NotifyConfigTest, RefusesAWebhookWithoutOrWithTwoAddresses) {
  EXPECT_THAT(faults("[[notify.webhook]]\n"), ElementsAre(HasSubstr("either url or url_file")));
  EXPECT_THAT(faults("[[notify.webhook]]\nurl = \"http://a\"\nurl_file = \"u\"\n"),
              ElementsAre(HasSubstr("either url or url_file")));
}

TEST_F(NotifyConfigTest, SendsNoTokenInPlainText) {
  write_secret("token", "abc", kPrivate);
  EXPECT_THAT(faults("[[notify.webhook]]\nurl = \"http://example.com\"\ntoken_file = \"token\"\n"),
              ElementsAre(HasSubstr("https:// is required")));
  EXPECT_TRUE(
      load_with("[[notify.webhook]]\nurl = \"http://127.0.0.1:1\"\ntoken_file = \"token\"\n"));
}

TEST_F(NotifyConfigTest, RefusesHeadersThatCannotBeUsed) {
  write_secret("token", "abc", kPrivate);
  for (const char* header : {"X Y", "X:", "Content-Length", "Host"})
    EXPECT_THAT(faults(std::string("[[notify.webhook]]\nurl = \"https://a\"\ntoken_file = "
                                   "\"token\"\nheader = \"") +
                       header + "\"\n"),
                ElementsAre(HasSubstr("notify.webhook[0].header")))
        << header;
  EXPECT_THAT(faults("[[notify.webhook]]\nurl = \"https://a\"\nheader = \"X-Token\"\n"),
              ElementsAre(HasSubstr("token_file")));
}

TEST_F(NotifyConfigTest, RefusesSecretsThatOthersCanRead) {
  write_secret("token", "abc", kPrivate | fs::perms::others_read);
  const std::string tables = "[[notify.webhook]]\nurl = \"https://a\"\ntoken_file = \"token\"\n";
  EXPECT_THAT(faults(tables), ElementsAre(AllOf(HasSubstr("notify.webhook[0].token_file"),
                                                HasSubstr("chmod 0640"))));
  fs::remove(folder_ / "token");
  EXPECT_THAT(faults(tables), ElementsAre(HasSubstr("No such file")));
}

TEST_F(NotifyConfigTest, CheckConfigFindsTheSame) {
  write_secret("token", "abc", kPrivate | fs::perms::others_read);
  (void)load_with("[[notify.webhook]]\nurl = \"https://a\"\ntoken_file = \"token\"\n");
  const auto checked = check_config(folder_ / "abbed.toml", 8);
  ASSERT_FALSE(checked);
  EXPECT_THAT(checked.error().details, Contains(HasSubstr("notify.webhook[0].token_file")));
  EXPECT_TRUE(load_config(folder_ / "abbed.toml")) << "abbed starts all the same";
}

TEST_F(NotifyConfigTest, RefusesMailsThatCannotBeSent) {
  const std::string mail = "[notify.mail]\nfrom = \"a@b\"\n";
  const std::string to = "to = [\"c@d\"]\n";
  for (const char* server : {"https://a", "smtp://a/path", "smtp://u:p@a", "a", "smtp://a?x"})
    EXPECT_THAT(faults(mail + to + "server = \"" + server + "\"\n"),
                ElementsAre(HasSubstr("notify.mail.server")))
        << server;
  for (const char* address : {"a", "a@", "@a", "a@b@c", "a b@c", "<a@b>", "a@b,c", "ä@b"})
    EXPECT_THAT(faults(mail + "server = \"smtps://a\"\nto = [\"" + address + "\"]\n"),
                ElementsAre(HasSubstr("notify.mail.to")))
        << address;
  EXPECT_THAT(faults(mail + "server = \"smtps://a\"\n"), ElementsAre(HasSubstr("1 to 16")));
  EXPECT_THAT(faults("[notify.mail]\n" + to), SizeIs(2)) << "server and from are missing";
  EXPECT_THAT(faults(mail + to + "server = \"smtps://a\"\nuser = \"u\"\n"),
              ElementsAre(HasSubstr("password_file are needed together")));
}

TEST_F(NotifyConfigTest, SendsNoPasswordInPlainText) {
  write_secret("password", "p", kPrivate);
  const std::string mail =
      "[notify.mail]\nfrom = \"a@b\"\nto = [\"c@d\"]\nuser = \"u\"\npassword_file = \"password\"\n"
      "starttls = false\n";
  EXPECT_THAT(faults(mail + "server = \"smtp://mail.example.com\"\n"),
              ElementsAre(HasSubstr("readable on the network")));
  EXPECT_TRUE(load_with(mail + "server = \"smtps://mail.example.com\"\n"));
}

/// A line end in an address would end a command of SMTP, or a header.
TEST_F(NotifyConfigTest, RefusesLineEndsInAddresses) {
  EXPECT_THAT(faults("[notify.mail]\nserver = \"smtps://a\"\nfrom = \"a@b\\r\\nRCPT TO:<e@e>\"\n"
                     "to = [\"c@d\"]\n"),
              Contains(HasSubstr("notify.mail.from")));
}

TEST_F(NotifyConfigTest, RefusesSecretsOfSeveralLines) {
  write_secret("token", "abc\r\nX-Other: 1", kPrivate);
  const auto settings =
      load_with("[[notify.webhook]]\nurl = \"https://a\"\ntoken_file = \"token\"\n");
  ASSERT_TRUE(settings);
  const auto receivers = notify::receivers_of(settings->notify);
  ASSERT_FALSE(receivers);
  EXPECT_THAT(receivers.error().text, HasSubstr("must be one line"));
}

}  // namespace
}  // namespace abbe::daemon
