/// Against a real HTTP server on loopback.
#include "webhook_server.hpp"

#include "abbe/notify/delivery.hpp"

#include <gmock/gmock.h>

#include "tls_certificate.hpp"

namespace abbe::notify {
namespace {

using namespace std::chrono_literals;
using abbe::test::HangingServer;
using abbe::test::WebhookServer;
using ::testing::Contains;
using ::testing::HasSubstr;
using Kind = TransferOutcome::Kind;

Receiver webhook(const std::string& url, const std::string& header = "",
                 const std::string& ca_file = "") {
  return {.name = "webhook 1", .way = Webhook{.url = url, .header = header}, .ca_file = ca_file};
}

Notification numbered(int number) {
  return {.id = std::to_string(number), .machine = "mill 7", .kind = "drift", .text = "DRIFT"};
}

/// For a computer that is busy: only a failure waits so long.
constexpr TransferLimits kPatientTransfer{.connect = 120s, .whole = 120s};

TransferOutcome sent_to(const Receiver& receiver, TransferLimits limits = kPatientTransfer) {
  return Transfer{limits}.send(receiver, numbered(1), 0);
}

TEST(WebhookTransfer, PostsJson) {
  WebhookServer server;
  const auto outcome = sent_to(webhook(server.url(), "Authorization: Bearer secret"));
  EXPECT_EQ(outcome.kind, Kind::Accepted) << outcome.text;
  ASSERT_EQ(server.requests().size(), 1u);
  const auto request = server.requests()[0];
  EXPECT_EQ(request.headers.find("Content-Type")->second, "application/json");
  EXPECT_EQ(request.headers.find("Authorization")->second, "Bearer secret");
  EXPECT_EQ(server.json(0)["text"], "INFO mill 7: DRIFT");
}

TEST(WebhookTransfer, TellsWhatMaySucceedLaterFromWhatIsRefused) {
  WebhookServer server;
  for (const auto& [status, kind] : std::map<int, Kind>{{201, Kind::Accepted},
                                                        {400, Kind::Refused},
                                                        {401, Kind::Refused},
                                                        {408, Kind::Failed},
                                                        {429, Kind::Failed},
                                                        {500, Kind::Failed},
                                                        {503, Kind::Failed}}) {
    server.refuse(1, status);
    const auto outcome = sent_to(webhook(server.url()));
    EXPECT_EQ(outcome.kind, kind) << status;
    EXPECT_THAT(outcome.text, HasSubstr("HTTP " + std::to_string(status)));
  }
}

TEST(WebhookTransfer, DoesNotFollowARedirect) {
  WebhookServer server;
  const auto outcome = sent_to(webhook(server.url("/moved")));
  EXPECT_EQ(outcome.kind, Kind::Refused);
  EXPECT_THAT(outcome.text, HasSubstr("redirect"));
  EXPECT_TRUE(server.requests().empty());
}

TEST(WebhookTransfer, EndsAfterItsTimeOutIfTheReceiverHangs) {
  const HangingServer server;
  const auto outcome = sent_to(webhook(server.at("http")), {.connect = 5000ms, .whole = 200ms});
  EXPECT_EQ(outcome.kind, Kind::Failed);
  EXPECT_THAT(outcome.text, HasSubstr("timed out"));
}

TEST(WebhookTransfer, NamesAReceiverThatIsDown) {
  std::string url;
  {
    const HangingServer gone;
    url = gone.at("http");
  }
  const auto outcome = sent_to(webhook(url));
  EXPECT_EQ(outcome.kind, Kind::Failed);
  EXPECT_THAT(outcome.text, HasSubstr("127.0.0.1"));
}

TEST(WebhookTransfer, SpeaksNoOtherScheme) {
  for (const char* url :
       {"file:///etc/passwd", "ftp://127.0.0.1/", "gopher://127.0.0.1/", "smtp://127.0.0.1/"})
    EXPECT_THAT(sent_to(webhook(url)).text, HasSubstr("not supported")) << url;
}

struct WebhookTls : test::TlsFolder {
  void SetUp() override {
    write_certificate();
    server_ = std::make_unique<WebhookServer>(
        std::make_unique<httplib::SSLServer>(certificate().c_str(), key().c_str()));
  }
  std::unique_ptr<WebhookServer> server_;
};

TEST_F(WebhookTls, VerifiesTheCertificate) {
  const auto outcome = sent_to(webhook(server_->url("/hook", "https")));
  EXPECT_EQ(outcome.kind, Kind::Failed);
  EXPECT_THAT(outcome.text, HasSubstr("certificate"));
  EXPECT_TRUE(server_->requests().empty());
}

TEST_F(WebhookTls, TrustsTheConfiguredCertificate) {
  const auto outcome = sent_to(webhook(server_->url("/hook", "https"), "", certificate()));
  EXPECT_EQ(outcome.kind, Kind::Accepted) << outcome.text;
}

TEST_F(WebhookTls, VerifiesTheName) {
  auto url = server_->url("/hook", "https");
  url.replace(url.find("127.0.0.1"), 9, "localhost");
  const auto outcome = sent_to(webhook(url, "", certificate()));
  EXPECT_EQ(outcome.kind, Kind::Failed);
  EXPECT_THAT(outcome.text, HasSubstr("localhost"));
  EXPECT_TRUE(server_->requests().empty());
}

/// Lines of the log, by the thread of a receiver.
struct DeliveryLog {
  void operator()(std::string_view line) {
    const std::lock_guard lock(mutex);
    lines.emplace_back(line);
    written.notify_all();
  }
  bool wait_for(std::size_t count) {
    std::unique_lock lock(mutex);
    return written.wait_for(lock, 30s, [&] { return lines.size() >= count; });
  }
  std::mutex mutex;
  std::condition_variable written;
  std::vector<std::string> lines;
};

struct DeliveryTest : ::testing::Test {
  std::unique_ptr<Delivery> deliver(const Receiver& receiver, std::size_t most_waiting = 100,
                                    std::chrono::milliseconds pause = 20ms) {
    return std::make_unique<Delivery>(
        receiver,
        DeliveryOptions{.pauses = {.first = pause, .longest = pause}, .most_waiting = most_waiting},
        [this](std::string_view line) { log_(line); });
  }
  DeliveryLog log_;
};

TEST_F(DeliveryTest, SendsInOrder) {
  WebhookServer server;
  const auto delivery = deliver(webhook(server.url()));
  for (int i = 1; i <= 3; ++i) delivery->push(numbered(i));
  ASSERT_TRUE(server.wait_for(3));
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(server.json(i)["id"], std::to_string(i + 1));
}

TEST_F(DeliveryTest, RepeatsUntilTheReceiverAccepts) {
  WebhookServer server;
  server.refuse(2, 500);
  {
    const auto delivery = deliver(webhook(server.url()));
    delivery->push(numbered(1));
    ASSERT_TRUE(server.wait_for(3));
    ASSERT_TRUE(log_.wait_for(3));
  }
  EXPECT_EQ(server.requests().size(), 3u);
  EXPECT_EQ(server.json(0)["id"], server.json(2)["id"]);
  EXPECT_THAT(log_.lines[0],
              ::testing::AllOf(HasSubstr("HTTP 500"), HasSubstr("tried again in 0.02 s")));
  EXPECT_THAT(log_.lines[2], HasSubstr("accepts again"));
}

TEST_F(DeliveryTest, DoesNotRepeatWhatTheReceiverRefuses) {
  WebhookServer server;
  server.refuse(1, 400);
  const auto delivery = deliver(webhook(server.url()));
  delivery->push(numbered(1));
  delivery->push(numbered(2));
  ASSERT_TRUE(server.wait_for(2));
  EXPECT_EQ(server.json(1)["id"], "2");
  EXPECT_EQ(server.json(1)["not_delivered"], 1);
}

TEST_F(DeliveryTest, ReportsHowManyWereDropped) {
  WebhookServer server;
  server.refuse(1, 500);
  const auto delivery = deliver(webhook(server.url()), 1, 1s);
  delivery->push(numbered(0));
  ASSERT_TRUE(log_.wait_for(1)) << "it waits for the pause";
  for (int i = 1; i <= 12; ++i) delivery->push(numbered(i));
  ASSERT_TRUE(server.wait_for(2));
  EXPECT_EQ(server.json(1)["id"], "12");
  EXPECT_THAT(server.json(1)["text"].get<std::string>(),
              HasSubstr("12 notifications were not delivered"));
}

TEST_F(DeliveryTest, EndsAtOnceWhileTheReceiverHangs) {
  const HangingServer server;
  auto delivery = deliver(webhook(server.at("http")));
  delivery->push(numbered(1));
  const auto begin = std::chrono::steady_clock::now();
  delivery.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 2s);
  EXPECT_THAT(log_.lines, Contains(HasSubstr("notifications not delivered: 1")));
}

TEST_F(DeliveryTest, DoesNotWaitForAReceiverThatHangs) {
  const HangingServer hanging;
  WebhookServer server;
  const auto first = deliver(webhook(hanging.at("http"))), second = deliver(webhook(server.url()));
  first->push(numbered(1));
  second->push(numbered(1));
  EXPECT_TRUE(server.wait_for(1));
}

}  // namespace
}  // namespace abbe::notify
