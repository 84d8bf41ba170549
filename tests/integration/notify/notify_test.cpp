/// abbe-notify between a real abbed and receivers on loopback.
#include "webhook_server.hpp"

#include <gmock/gmock.h>
#include <signal.h>

#include <set>

#include "smtp_server.hpp"
#include "spine.hpp"

namespace abbe::test {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class Notify : public Spine {
 protected:
  /// Nothing answers at port 1: the devices are away.
  void configure(const std::string& notify) {
    tracker_port_ = can_port_ = 1;
    write_configuration();
    write("abbed.toml", text_of(file("abbed.toml")) + "[notify]\nsettle_s = 2\n" + notify);
  }
  static std::string webhook(const std::string& url) {
    return "[[notify.webhook]]\nurl = \"" + url + "\"\n";
  }
  static std::string mail(const SmtpServer& server) {
    return "[notify.mail]\nstarttls = false\nserver = \"" + server.url() +
           "\"\nfrom = \"abbe@example.com\"\nto = [\"anna@example.com\", \"otto@example.com\"]\n";
  }
  void start_notify() {
    notify_ = start({ABBE_NOTIFY_PROGRAM, "--config", file("abbed.toml")}, "notify");
    ASSERT_TRUE(eventually([this] { return has_logged("sends to") || !notify_->running(); }));
    ASSERT_TRUE(notify_->running()) << notify_->err();
  }
  [[nodiscard]] bool has_logged(const std::string& text) const {
    return notify_->err().find(text) != std::string::npos;
  }
  [[nodiscard]] Outcome test_message() const {
    return run({ABBE_NOTIFY_PROGRAM, "--config", file("abbed.toml"), "--test"});
  }
  /// The notifications of this kind and phase, of all that have arrived.
  static std::vector<json> of(const WebhookServer& server, const std::string& event,
                              const std::string& phase) {
    std::vector<json> out;
    for (const auto& request : server.requests())
      if (const auto sent = json::parse(request.body);
          sent["event"] == event && sent["phase"] == phase)
        out.push_back(sent);
    return out;
  }
  std::unique_ptr<Program> notify_;
};

TEST_F(Notify, ReportsAnExistingAlarmOnceAndADaemonThatIsGone) {
  WebhookServer server;
  SmtpServer mails;
  configure(webhook(server.url()) + mail(mails));
  start_abbed();
  ASSERT_NO_FATAL_FAILURE(start_notify());
  ASSERT_TRUE(server.wait_for(1));
  const auto lost = of(server, "device_lost", "begins");
  ASSERT_EQ(lost.size(), 1u) << server.requests()[0].body;
  EXPECT_THAT(lost[0]["subjects"], testing::Contains("tracker"));
  EXPECT_THAT(lost[0]["text"].get<std::string>(), HasSubstr("tracker: "));
  EXPECT_EQ(lost[0]["machine"], status()["machine"]);
  EXPECT_TRUE(mails.wait_for(2));
  std::set<std::string> recipients;
  for (const ReceivedMail& received : mails.mails()) recipients.insert(received.to);
  EXPECT_EQ(recipients, (std::set<std::string>{"<anna@example.com>", "<otto@example.com>"}));

  abbed_->signal(SIGKILL);
  ASSERT_TRUE(eventually([&] { return !of(server, "not_reachable", "begins").empty(); }));
  EXPECT_THAT(of(server, "not_reachable", "begins")[0]["message"].get<std::string>(),
              HasSubstr("is abbed running?"));
  EXPECT_EQ(of(server, "device_lost", "begins").size(), 1u);
  EXPECT_EQ(notify_->stop(), 0) << notify_->err();
}

TEST_F(Notify, EndsWithinTwoSecondsWhileReceiversHang) {
  const HangingServer hanging;
  configure(webhook(hanging.at("http")) + webhook(hanging.at("https")) +
            "[notify.mail]\nserver = \"" + hanging.at("smtps") +
            "\"\nfrom = \"abbe@example.com\"\nto = [\"anna@example.com\"]\n");
  ASSERT_NO_FATAL_FAILURE(start_notify());
  ASSERT_TRUE(eventually([this] { return has_logged("is abbed running?"); }));
  const auto reported = std::chrono::steady_clock::now() + 3s;  // settle_s, and a look
  ASSERT_TRUE(eventually([&] { return std::chrono::steady_clock::now() > reported; }));
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(notify_->stop(), 0);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 2s);
  EXPECT_THAT(notify_->err(), HasSubstr("notifications not delivered: 1"));
}

TEST_F(Notify, EndsWithinTwoSecondsWhileAbbedHangs) {
  WebhookServer server;
  configure(webhook(server.url()));
  start_abbed();
  ASSERT_NO_FATAL_FAILURE(start_notify());
  ASSERT_TRUE(eventually([this] { return has_logged("abbed answers"); }));
  abbed_->signal(SIGSTOP);
  EXPECT_TRUE(eventually([this] { return has_logged("no answer in"); }));
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(notify_->stop(), 0);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 2s);
  abbed_->signal(SIGCONT);
}

TEST_F(Notify, TestsEveryReceiver) {
  WebhookServer server;
  SmtpServer mails;
  configure(webhook(server.url()) + mail(mails));
  const auto tested = test_message();
  EXPECT_EQ(tested.code, 0) << tested.err;
  EXPECT_THAT(tested.out,
              AllOf(HasSubstr("webhook 1 (http://127.0.0.1:"),
                    HasSubstr("mail to anna@example.com"), HasSubstr("mail to otto@example.com")));
  ASSERT_EQ(server.requests().size(), 1u);
  EXPECT_EQ(server.json(0)["event"], "test");
  EXPECT_EQ(mails.mails().size(), 2u);
}

TEST_F(Notify, NamesTheReceiversThatDoNotAcceptTheTest) {
  WebhookServer server;
  SmtpServer mails({{"RCPT TO:<otto", "550 no such user"}});
  configure(webhook(server.url()) + webhook(server.url("/nowhere")) + mail(mails));
  const auto tested = test_message();
  EXPECT_EQ(tested.code, 4);
  EXPECT_THAT(tested.out, AllOf(HasSubstr("webhook 1"), HasSubstr("mail to anna")));
  EXPECT_THAT(tested.err, AllOf(HasSubstr("webhook 2"), HasSubstr("HTTP 404"),
                                HasSubstr("mail to otto@example.com"), HasSubstr("550"),
                                Not(HasSubstr("mail to anna"))));
}

TEST_F(Notify, RefusesAFaultyConfigurationWithItsPlace) {
  configure("events = [\"rain\"]\n[[notify.webhook]]\nurl = \"ftp://a\"\nurll = 1\n");
  const auto refused = run({ABBE_NOTIFY_PROGRAM, "--config", file("abbed.toml")});
  EXPECT_EQ(refused.code, 3);
  for (const char* key : {"notify.events", "notify.webhook[0].url", "notify.webhook[0].urll"})
    EXPECT_THAT(refused.err, HasSubstr(key));
  EXPECT_THAT(refused.err, testing::ContainsRegex("abbed.toml:[0-9]+:[0-9]+: notify"));
  const auto checked = run({ABBED_PROGRAM, "--check-config", "--config", file("abbed.toml")});
  EXPECT_EQ(checked.code, 3);
  EXPECT_THAT(checked.err, HasSubstr("notify.events"));
}

TEST_F(Notify, NeedsAReceiver) {
  configure("");
  const auto refused = run({ABBE_NOTIFY_PROGRAM, "--config", file("abbed.toml")});
  EXPECT_EQ(refused.code, 3);
  EXPECT_THAT(refused.err, HasSubstr("[notify] has no receiver"));
  EXPECT_EQ(run({ABBED_PROGRAM, "--check-config", "--config", file("abbed.toml")}).code, 0);
}

}  // namespace
}  // namespace abbe::test
