/// aiosmtpd as the mail server, and Python's parser of mails: neither was written for abbe.
#include <gmock/gmock.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>

#include "abbe/notify/transfer.hpp"
#include "tls_certificate.hpp"

namespace abbe::notify {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// For a computer that is busy: only a failure waits so long.
constexpr TransferLimits kPatient{.connect = std::chrono::seconds{120},
                                  .whole = std::chrono::seconds{120}};
const std::string kMachine = "Fräsmaschine 工作機械 7";

struct SmtpPeer : test::TlsFolder {
  void SetUp() override {
    if (std::system("/usr/bin/python3 -c 'import aiosmtpd' 2>/dev/null") != 0)
      GTEST_SKIP() << "aiosmtpd is not installed (Debian: python3-aiosmtpd)";
    write_certificate();
    const std::string command =
        "exec /usr/bin/python3 " ABBE_SMTP_PEER " " + certificate() + " " + key() + " 2>/dev/null";
    peer_.reset(::popen(command.c_str(), "r"));
    port_ = line();
    ASSERT_FALSE(port_.empty());
  }
  [[nodiscard]] std::string line() const {
    std::string out;
    for (int c = 0; (c = std::fgetc(peer_.get())) != EOF && c != '\n';) out += static_cast<char>(c);
    return out;
  }
  [[nodiscard]] Receiver receiver(const std::string& password) const {
    return {.name = "mail",
            .way = Mailbox{.server = "smtp://127.0.0.1:" + port_,
                           .starttls = true,
                           .user = "user",
                           .password = password,
                           .from = "abbe@example.com",
                           .recipient = "anna@example.com",
                           .all_recipients = {"anna@example.com", "otto@example.com"}},
            .ca_file = certificate()};
  }

  std::unique_ptr<FILE, int (*)(FILE*)> peer_{nullptr, &::pclose};
  std::string port_;
};

TEST_F(SmtpPeer, ReadsTheMailAsItWasMeant) {
  const Notification notification{.id = "run.1",
                                  .machine = kMachine,
                                  .kind = "drift",
                                  .severity = Severity::Warning,
                                  .text = "model 886b7a: DRIFT: EXX größer\r\nBcc: eve@x",
                                  .model_id = "886b7a",
                                  .time = protocol::UtcTime{std::chrono::seconds{1715934600}}};
  const auto wrong = Transfer{kPatient}.send(receiver("wrong"), notification, 0);
  EXPECT_EQ(wrong.kind, TransferOutcome::Kind::Refused) << wrong.text;
  auto untrusted = receiver("secret");
  untrusted.ca_file.clear();
  EXPECT_EQ(Transfer{kPatient}.send(untrusted, notification, 0).kind,
            TransferOutcome::Kind::Failed);
  const auto outcome = Transfer{kPatient}.send(receiver("secret"), notification, 0);
  ASSERT_EQ(outcome.kind, TransferOutcome::Kind::Accepted) << outcome.text;

  const json mail = json::parse(line());
  EXPECT_EQ(mail["tls"], true);
  EXPECT_EQ(mail["from"], "abbe@example.com");
  EXPECT_EQ(mail["to"], json{"anna@example.com"});
  EXPECT_EQ(mail["subject"],
            "WARNING " + kMachine + ": model 886b7a: DRIFT: EXX größer  Bcc: eve@x");
  EXPECT_EQ(mail["header_to"], "anna@example.com, otto@example.com");
  EXPECT_EQ(mail["names"], (json{"Date", "From", "To", "Subject", "Message-ID", "Auto-Submitted",
                                 "MIME-Version", "Content-Type", "Content-Transfer-Encoding"}));
  EXPECT_THAT(mail["defects"], IsEmpty());
  EXPECT_EQ(mail["date"], "2024-05-17T08:30:00+00:00");
  EXPECT_THAT(mail["body"].get<std::string>(), HasSubstr(kMachine));
}

}  // namespace
}  // namespace abbe::notify
