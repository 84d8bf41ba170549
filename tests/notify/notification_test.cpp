#include "abbe/notify/notification.hpp"

#include <gmock/gmock.h>
#include <openssl/evp.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

namespace abbe::notify {
namespace {

using nlohmann::json;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

const MailAddresses kAddresses{.from = "abbe@example.com",
                               .to = {"anna@example.com", "otto@example.com"}};

Notification example() {
  return {.id = "run.1",
          .machine = "mill 7",
          .kind = "device_lost",
          .phase = Phase::Begins,
          .severity = Severity::Fault,
          .text = "tracker: connecting; last fault: no reply in 200 ms",
          .subjects = {"tracker"},
          .time = protocol::UtcTime{std::chrono::seconds{1715934600}}};
}

std::string decoded(const std::string& digits) {
  std::string bytes(digits.size() / 4 * 3, '\0');
  auto* const out = reinterpret_cast<unsigned char*>(bytes.data());              // NOLINT
  const auto* const in = reinterpret_cast<const unsigned char*>(digits.data());  // NOLINT
  EXPECT_GE(EVP_DecodeBlock(out, in, static_cast<int>(digits.size())), 0);
  bytes.resize(bytes.size() - static_cast<std::size_t>(std::ranges::count(digits, '=')));
  return bytes;
}

/// The text of a header's encoded words.
std::string text_of_words(const std::string& header) {
  const std::regex word{R"(=\?UTF-8\?B\?([A-Za-z0-9+/=]+)\?=)"};
  std::string out;
  for (std::sregex_iterator it(header.begin(), header.end(), word), end; it != end; ++it)
    out += decoded((*it)[1]);
  return out;
}

struct MailParts {
  std::vector<std::string> headers;  ///< with their continuations
  std::string body;
};

MailParts parts_of(const std::string& mail) {
  MailParts parts;
  const auto end = mail.find("\r\n\r\n");
  std::istringstream lines(mail.substr(0, end));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(' '))
      parts.headers.back() += "\n" + line;
    else
      parts.headers.push_back(line);
  }
  std::string digits = mail.substr(end + 4);
  std::erase_if(digits, [](char c) { return c == '\r' || c == '\n'; });
  parts.body = decoded(digits);
  return parts;
}

TEST(Notification, AsJsonHasTheMembersOfTheDocument) {
  auto notification = example();
  notification.model_id = "446300b9739c2c1a";
  notification.session = 3;
  notification.changes = 12;
  const json sent = json::parse(json_of(notification, 2));
  EXPECT_EQ(sent["schema"], 1);
  EXPECT_EQ(sent["id"], "run.1");
  EXPECT_EQ(sent["machine"], "mill 7");
  EXPECT_EQ(sent["event"], "device_lost");
  EXPECT_EQ(sent["phase"], "begins");
  EXPECT_EQ(sent["severity"], "fault");
  EXPECT_EQ(sent["time"], "2024-05-17T08:30:00.000000000Z");
  EXPECT_THAT(sent["local_time"].get<std::string>(), HasSubstr("2024-05-17"));
  EXPECT_EQ(sent["message"], notification.text);
  EXPECT_EQ(sent["subjects"], json{"tracker"});
  EXPECT_EQ(sent["model_id"], "446300b9739c2c1a");
  EXPECT_EQ(sent["session"], 3);
  EXPECT_EQ(sent["changes"], 12);
  EXPECT_EQ(sent["not_delivered"], 2);
}

TEST(Notification, HasOneTextForReceiversThatShowOne) {
  EXPECT_EQ(json::parse(json_of(example(), 0))["text"],
            "FAULT mill 7: tracker: connecting; last fault: no reply in 200 ms");
  auto notification = example();
  notification.changes = 60;
  notification.simulated = true;
  EXPECT_EQ(json::parse(json_of(notification, 12))["text"],
            "FAULT mill 7: SIMULATED devices: tracker: connecting; last fault: no reply in 200 ms; "
            "60 changes; 12 notifications were not delivered");
}

TEST(Notification, AsMailHasItsHeaders) {
  const auto mail = parts_of(mail_of(example(), 0, kAddresses));
  EXPECT_THAT(mail.headers,
              ElementsAre("Date: Fri, 17 May 2024 08:30:00 +0000\r", "From: abbe@example.com\r",
                          "To: anna@example.com,\r\n otto@example.com\r", StartsWith("Subject: "),
                          "Message-ID: <run.1@example.com>\r", "Auto-Submitted: auto-generated\r",
                          "MIME-Version: 1.0\r", "Content-Type: text/plain; charset=utf-8\r",
                          "Content-Transfer-Encoding: base64"));
  EXPECT_EQ(text_of_words(mail.headers[3]),
            "FAULT mill 7: tracker: connecting; last fault: no reply in 200 ms");
  EXPECT_THAT(mail.body, StartsWith("FAULT mill 7: tracker: connecting"));
  EXPECT_THAT(mail.body, HasSubstr("\nUTC        2024-05-17T08:30:00.000000000Z\n"));
}

TEST(Notification, CannotGetAHeaderFromANameOrAText) {
  auto notification = example();
  notification.machine = "mill\r\nBcc: eve@example.com\r\n\r\nbody";
  notification.text = "x\nSubject: other\n\n.\nQUIT";
  const auto mail = parts_of(mail_of(notification, 0, kAddresses));
  EXPECT_THAT(mail.headers, SizeIs(9));
  EXPECT_THAT(mail.headers, Each(Not(StartsWith("Bcc"))));
  EXPECT_THAT(text_of_words(mail.headers[3]), StartsWith("FAULT mill  Bcc: eve@example.com"));
  const json sent = json::parse(json_of(notification, 0));
  EXPECT_THAT(sent["text"].get<std::string>(), Not(HasSubstr("\n")));
}

TEST(Notification, SendsNoLongLines) {
  auto notification = example();
  for (int i = 0; i < 500; ++i) notification.text += " größer";
  std::istringstream lines(mail_of(notification, 0, kAddresses));
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LE(line.size(), 77u) << line;
    EXPECT_THAT(line, EndsWith("\r"));
  }
}

TEST(HeaderText, LeavesShortAsciiAsItIs) {
  EXPECT_EQ(header_text("INFO mill 7: abbed answers"), "INFO mill 7: abbed answers");
}

TEST(HeaderText, EncodesWhatIsNotAscii) {
  const auto header = header_text("Fräsmaschine 工作機械");
  EXPECT_THAT(header, StartsWith("=?UTF-8?B?"));
  EXPECT_EQ(text_of_words(header), "Fräsmaschine 工作機械");
}

TEST(HeaderText, EncodesWhatLooksEncoded) {
  EXPECT_EQ(text_of_words(header_text("=?UTF-8?B?eA==?=")), "=?UTF-8?B?eA==?=");
}

TEST(HeaderText, CutsBetweenCharacters) {
  std::string text;
  for (int i = 0; i < 40; ++i) text += "工";
  const auto header = header_text(text);
  const std::regex word{R"(=\?UTF-8\?B\?([A-Za-z0-9+/=]+)\?=)"};
  for (std::sregex_iterator it(header.begin(), header.end(), word), end; it != end; ++it) {
    EXPECT_LE(it->length(), 75);
    EXPECT_EQ(decoded((*it)[1]).size() % 3, 0u) << "whole characters of three bytes";
  }
  EXPECT_EQ(text_of_words(header), text);
}

TEST(HeaderText, EndsWithBytesThatAreNotUtf8) {
  EXPECT_EQ(text_of_words(header_text(std::string(100, '\x80'))).substr(0, 45),
            std::string(45, '\x80'));
}

}  // namespace
}  // namespace abbe::notify
