/// Against the mail server of the tests.
#include <gmock/gmock.h>

#include "abbe/notify/transfer.hpp"
#include "smtp_server.hpp"
#include "webhook_server.hpp"

namespace abbe::notify {
namespace {

using namespace std::chrono_literals;
using abbe::test::SmtpServer;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;
using MailKind = TransferOutcome::Kind;

Receiver mailbox(const std::string& server, bool starttls = false) {
  return {.name = "mail",
          .way = Mailbox{.server = server,
                         .starttls = starttls,
                         .user = {},
                         .password = {},
                         .from = "abbe@example.com",
                         .recipient = "anna@example.com",
                         .all_recipients = {"anna@example.com", "otto@example.com"}},
          .ca_file = {}};
}

TransferOutcome mailed(const Receiver& receiver, const std::string& text = "DRIFT",
                       TransferLimits limits = {}) {
  const Notification notification{
      .id = "run.1", .machine = "mill 7", .kind = "drift", .text = text};
  return Transfer{limits}.send(receiver, notification, 0);
}

TEST(MailTransfer, SendsToOneRecipient) {
  SmtpServer server;
  const auto outcome = mailed(mailbox(server.url()));
  EXPECT_EQ(outcome.kind, MailKind::Accepted) << outcome.text;
  ASSERT_THAT(server.mails(), SizeIs(1));
  const auto mail = server.mails()[0];
  EXPECT_EQ(mail.from, "<abbe@example.com>");
  EXPECT_EQ(mail.to, "<anna@example.com>");
  EXPECT_THAT(mail.data, HasSubstr("\r\nTo: anna@example.com,\r\n otto@example.com\r\n"));
  EXPECT_THAT(mail.data, HasSubstr("\r\nSubject: INFO mill 7: DRIFT\r\n"));
}

TEST(MailTransfer, LogsIn) {
  SmtpServer server;
  auto receiver = mailbox(server.url());
  std::get<Mailbox>(receiver.way).user = "u";
  std::get<Mailbox>(receiver.way).password = "p";
  EXPECT_EQ(mailed(receiver).kind, MailKind::Accepted);
  ASSERT_THAT(server.mails(), SizeIs(1));
  EXPECT_EQ(server.mails()[0].login, "AHUAcA==\r\n") << "NUL u NUL p in base64";
}

TEST(MailTransfer, TellsForGoodFromLater) {
  SmtpServer unknown({{"RCPT", "550 no such user"}}), busy({{"RCPT", "451 try again later"}}),
      content({{"content", "554 refused"}});
  auto outcome = mailed(mailbox(unknown.url()));
  EXPECT_EQ(outcome.kind, MailKind::Refused);
  EXPECT_THAT(outcome.text, HasSubstr("550"));
  outcome = mailed(mailbox(busy.url()));
  EXPECT_EQ(outcome.kind, MailKind::Failed);
  EXPECT_THAT(outcome.text, HasSubstr("451"));
  outcome = mailed(mailbox(content.url()));
  EXPECT_EQ(outcome.kind, MailKind::Refused);
  EXPECT_THAT(outcome.text, HasSubstr("554"));
}

TEST(MailTransfer, SendsNothingWithoutTlsIfItIsRequired) {
  SmtpServer server;
  const auto outcome = mailed(mailbox(server.url(), true));
  EXPECT_EQ(outcome.kind, MailKind::Failed) << outcome.text;
  EXPECT_THAT(server.commands(), Each(Not(StartsWith("MAIL"))));
}

TEST(MailTransfer, CannotBeGivenACommandByAText) {
  SmtpServer server;
  EXPECT_EQ(mailed(mailbox(server.url()), "x\r\n.\r\nMAIL FROM:<eve@example.com>\r\n").kind,
            MailKind::Accepted);
  ASSERT_THAT(server.mails(), SizeIs(1));
  EXPECT_THAT(server.commands(), Not(Contains(HasSubstr("eve"))));
}

TEST(MailTransfer, EndsAfterItsTimeOutIfTheServerHangs) {
  const abbe::test::HangingServer server;
  const auto outcome =
      mailed(mailbox(server.at("smtp")), "DRIFT", {.connect = 5000ms, .whole = 200ms});
  EXPECT_EQ(outcome.kind, MailKind::Failed);
  EXPECT_THAT(outcome.text, HasSubstr("timed out"));
}

}  // namespace
}  // namespace abbe::notify
