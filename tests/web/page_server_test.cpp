/// The page over HTTP, from the point of view of browsers: what they see without and with a log in,
/// and what they cannot do. abbed does not run here; tests/integration/spine/web_test.cpp has it.

#include <httplib.h>

#undef _res  // a macro of resolv.h, which changes headers of Eigen

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/sha256.hpp"
#include "abbe/web/certificate.hpp"
#include "page_fixture.hpp"

namespace abbe::web {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using test::all_of;
using test::connection;
using test::get_request;
using test::kPassword;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

struct PageServerTest : test::PageFixture {};

TEST_F(PageServerTest, ServesThePageWithItsLibrariesAndStrictHeaders) {
  ASSERT_NO_FATAL_FAILURE(start());
  auto client = browser();
  for (const char* file : {"/", "/main.js", "/style.css", "/three.min.js", "/chart.min.js"}) {
    const auto answer = client.Get(file);
    ASSERT_TRUE(answer) << file;
    EXPECT_EQ(answer->status, 200) << file;
    EXPECT_FALSE(answer->body.empty()) << file;
    const std::string policy = answer->get_header_value("Content-Security-Policy");
    EXPECT_THAT(policy, HasSubstr("default-src 'none'"));
    EXPECT_THAT(policy, Not(HasSubstr("unsafe")));
    EXPECT_EQ(answer->get_header_value("X-Content-Type-Options"), "nosniff");
  }
  for (const char* file :
       {"/etc/passwd", "/../abbed.toml", "/recordings/../users", "/recordings/%2e%2e%2fusers"})
    EXPECT_GE(client.Get(file)->status, 400) << file;
}

TEST_F(PageServerTest, ShowsWithoutALogInAndChangesNothing) {
  ASSERT_NO_FATAL_FAILURE(start());
  auto client = browser();
  const auto me = client.Get("/api/me");
  ASSERT_TRUE(me);
  EXPECT_TRUE(json::parse(me->body)["may_view"]);
  EXPECT_EQ(client.Get("/api/history")->status, 200);
  for (const char* path :
       {"/api/activate", "/api/rollback", "/api/calibrate", "/api/cancel", "/api/replay"})
    EXPECT_EQ(post({}, path, json::object()), 401) << path;
}

TEST_F(PageServerTest, ShowsNothingBeforeALogInIfSoConfigured) {
  ASSERT_NO_FATAL_FAILURE(start("view_without_login = false\n"));
  auto client = browser();
  for (const char* path : {"/api/history", "/api/status", "/api/curves/5min", "/events",
                           "/api/configuration", "/recordings/a.mcap"})
    EXPECT_EQ(client.Get(path)->status, 401) << path;
  const auto in = log_in("view");
  EXPECT_EQ(client.Get("/api/history", in.headers)->status, 200);
}

TEST_F(PageServerTest, AnswersTheCurvesOfAWindow) {
  ASSERT_NO_FATAL_FAILURE(start());
  auto client = browser();
  const auto whole = json::parse(client.Get("/api/curves/5min")->body);
  EXPECT_EQ(whole["step_s"], 1);
  EXPECT_TRUE(whole["curves"].empty()) << "abbed does not run";
  const std::int64_t last = whole["first"].get<std::int64_t>() + whole["length"].get<int>() - 1;
  const auto rest = json::parse(client.Get("/api/curves/5min/" + std::to_string(last))->body);
  EXPECT_EQ(rest["first"], last);
  EXPECT_EQ(client.Get("/api/curves/2h")->status, 404);
  for (const char* number : {"", "1x", "99999999999999999999"})
    EXPECT_EQ(client.Get(std::string{"/api/curves/5min/"} + number)->status, 400) << number;
}

TEST_F(PageServerTest, ARoleMayDoWhatItNamesAndNoMore) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto view = log_in("view"), calibrate = log_in("calibrate"),
             administer = log_in("administer");
  const json id{{"id", "0123456789abcdef"}};
  EXPECT_EQ(post(view.headers, "/api/cancel", json::object()), 403);
  EXPECT_EQ(post(calibrate.headers, "/api/activate", id), 403);
  EXPECT_THAT(log(),
              Contains(HasSubstr("/api/activate refused to calibrate: needs the role administer")));
  // Allowed, but abbed does not run.
  EXPECT_EQ(post(calibrate.headers, "/api/cancel", json::object()), 503);
  EXPECT_EQ(post(administer.headers, "/api/activate", id), 503);
}

TEST_F(PageServerTest, AChangeNeedsTheTokenAndComesFromThisSite) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto in = log_in("administer");
  httplib::Headers without = in.headers;
  without.erase("X-CSRF-Token");
  EXPECT_EQ(post(without, "/api/cancel", json::object()), 403);
  httplib::Headers other = in.headers;
  other.emplace("Origin", "https://evil.example");
  EXPECT_EQ(post(other, "/api/cancel", json::object()), 403);
  EXPECT_THAT(log(), Contains(HasSubstr("another site, https://evil.example")));
  // A form of another site cannot send this type.
  auto client = browser();
  EXPECT_EQ(client.Post("/api/cancel", in.headers, "{}", "text/plain")->status, 415);
  EXPECT_EQ(post(in.headers, "/api/cancel", json::object()), 503);
}

TEST_F(PageServerTest, ARequestForAnotherNameIsRefused) {
  ASSERT_NO_FATAL_FAILURE(start("host_names = [\"press3.example\"]\n"));
  auto client = browser();
  EXPECT_EQ(client.Get("/api/me", {{"Host", "evil.example"}})->status, 421);
  EXPECT_EQ(client.Get("/api/me", {{"Host", "press3.example:8440"}})->status, 200);
  EXPECT_THAT(log(), Contains(HasSubstr("\"evil.example\" is not a name of this page")));
}

TEST_F(PageServerTest, EventsEndWhenTheirUserLogsOut) {
  ASSERT_NO_FATAL_FAILURE(start("view_without_login = false\n"));
  const auto in = log_in("view");
  const auto cookie = "Cookie: " + in.headers.find("Cookie")->second + "\r\n";
  const auto events = connection(page_->port(), get_request("/events", cookie));
  char first = 0;
  ASSERT_EQ(::recv(events.get(), &first, 1, 0), 1);
  EXPECT_EQ(first, 'H');  // of HTTP
  EXPECT_EQ(post(in.headers, "/api/logout", json::object()), 200);
  EXPECT_THAT(all_of(events), HasSubstr(" 200 "));  // and then the end
}

TEST_F(PageServerTest, TheConfigurationHasTheHashOfItsFile) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto hash = [this] {
    return json::parse(browser().Get("/api/configuration")->body).value("sha256", "");
  };
  const std::string before = hash();
  EXPECT_EQ(before, daemon::sha256_hex_of_file(folder_ / "abbed.toml").value());
  write("abbed.toml", "[machine]\n");  // faults do not hide it
  EXPECT_NE(hash(), before);
  EXPECT_EQ(hash(), daemon::sha256_hex_of_file(folder_ / "abbed.toml").value());
}

TEST_F(PageServerTest, ADownloadGoesOnAfterABreak) {
  std::filesystem::create_directories(folder_ / "data/recordings");
  std::string bytes;
  for (int i = 0; bytes.size() < 300'000; ++i) bytes += fmt::format("{},", i);
  write("data/recordings/a.mcap", bytes);
  ASSERT_NO_FATAL_FAILURE(start());
  auto client = browser();
  std::string first, etag;
  (void)client.Get(
      "/recordings/a.mcap",
      [&](const httplib::Response& answer) {
        etag = answer.get_header_value("ETag");
        return answer.status == 200 && answer.get_header_value("Accept-Ranges") == "bytes";
      },
      [&](const char* part, std::size_t size) {
        first.append(part, size);
        return first.size() < 100'000;
      });
  ASSERT_GE(first.size(), 100'000u);
  ASSERT_LT(first.size(), bytes.size());

  const auto rest_of = [&](const std::string& range, const std::string& if_range) {
    return browser().Get("/recordings/a.mcap", {{"Range", range}, {"If-Range", if_range}});
  };
  const std::string range = fmt::format("bytes={}-", first.size());
  const auto rest = rest_of(range, etag);
  ASSERT_TRUE(rest);
  EXPECT_EQ(rest->status, 206);
  EXPECT_EQ(rest->get_header_value("Content-Range"),
            fmt::format("bytes {}-{}/{}", first.size(), bytes.size() - 1, bytes.size()));
  EXPECT_EQ(first + rest->body, bytes);

  const auto beyond = rest_of(fmt::format("bytes={}-", bytes.size()), etag);
  EXPECT_EQ(beyond->status, 416);
  EXPECT_EQ(beyond->get_header_value("Content-Range"), fmt::format("bytes */{}", bytes.size()));
  EXPECT_EQ(rest_of("bytes=0-1,5-6", etag)->body, bytes) << "several ranges: the whole";

  write("data/recordings/a.mcap", bytes + "more");  // another recording of the same name
  const auto other = rest_of(range, etag);
  EXPECT_EQ(other->status, 200);
  EXPECT_EQ(other->body, bytes + "more");
  write("data/recordings/b.mcap.part", bytes);  // still grows
  const auto running = browser().Get("/recordings/b.mcap.part", {{"Range", range}});
  EXPECT_EQ(running->status, 200);
  EXPECT_FALSE(running->has_header("ETag"));
}

TEST_F(PageServerTest, ARecordingWithAForgedNameIsNotServed) {
  std::filesystem::create_directories(folder_ / "data/recordings");
  write("data/recordings/secret", "secret");
  std::filesystem::create_symlink(folder_ / "users", folder_ / "data/recordings/link.mcap");
  ASSERT_EQ(::mkfifo((folder_ / "data/recordings/pipe.mcap").c_str(), 0600), 0);
  ASSERT_NO_FATAL_FAILURE(start());
  auto client = browser();
  for (const char* name : {"secret", "secret%00.mcap", "link.mcap", "pipe.mcap", "..%2fusers"})
    EXPECT_EQ(client.Get(std::string{"/recordings/"} + name)->status, 404) << name;
  EXPECT_EQ(json::parse(client.Get("/api/recordings")->body), json::array());
}

/// abbed as the page sees it: `answers` gives the answer to a request, by "do".
std::unique_ptr<daemon::ControlServer> fake_abbed(const std::filesystem::path& folder,
                                                  std::map<std::string, json> answers) {
  std::filesystem::create_directories(folder / "run");
  auto server = daemon::ControlServer::open(
      folder / "run/control.sock",
      [answers = std::move(answers)](const json& request, const daemon::ControlPeer&) {
        const auto found = answers.find(request.at("do").get<std::string>());
        if (found != answers.end()) return found->second;
        return daemon::refusal({daemon::ErrorCode::Refused, "not in this test"});
      });
  EXPECT_TRUE(server);
  return std::move(*server);
}

TEST_F(PageServerTest, AChangeDoesNotWaitForeverForAnotherOneNorDoesTheEnd) {
  const auto abbed = fake_abbed(folder_, {{"activate", {{"ok", true}, {"change", 1}}},
                                          {"change", {{"ok", true}, {"change", 1}}}});
  ASSERT_NO_FATAL_FAILURE(start());
  const auto in = log_in("administer");
  const json id{{"id", "0123456789abcdef"}};
  std::array<std::atomic<int>, 2> statuses{};
  std::vector<std::thread> users;
  for (std::atomic<int>& status : statuses)
    users.emplace_back([&in, &id, &status, port = page_->port()] {
      httplib::Client client{"127.0.0.1", port};
      const auto answer = client.Post("/api/activate", in.headers, id.dump(), "application/json");
      status = answer ? answer->status : -1;
    });
  // One of them waits for the store, which never answers; the other one for its turn.
  while (statuses[0] == 0 && statuses[1] == 0) std::this_thread::sleep_for(10ms);
  page_.reset();
  for (std::thread& user : users) user.join();
  for (const std::atomic<int>& status : statuses) EXPECT_EQ(status, 503);
}

TEST_F(PageServerTest, AnAnswerOfAbbedWithoutPositionsIsAnEventWithoutPositions) {
  const auto abbed = fake_abbed(folder_, {{"status", {{"ok", true}}}, {"live", {{"ok", true}}}});
  ASSERT_NO_FATAL_FAILURE(start());
  const auto events = connection(page_->port(), get_request("/events"));
  std::string seen;
  std::array<char, 4096> buffer{};
  for (ssize_t n = 0; seen.find("event: live\ndata: []\n") == std::string::npos &&
                      (n = ::recv(events.get(), buffer.data(), buffer.size(), 0)) > 0;)
    seen.append(buffer.data(), static_cast<std::size_t>(n));
  EXPECT_THAT(seen, HasSubstr("event: live\ndata: []\n"));
}

TEST_F(PageServerTest, ABodyThatIsTooLargeOrNotJsonIsRefused) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto in = log_in("calibrate");
  auto client = browser();
  EXPECT_EQ(client.Post("/api/calibrate", in.headers, "{", "application/json")->status, 400);
  EXPECT_EQ(client.Post("/api/calibrate", in.headers, "[]", "application/json")->status, 400);
  const auto large =
      client.Post("/api/calibrate", in.headers, std::string(2u << 20, ' '), "application/json");
  EXPECT_TRUE(!large || large->status == 413) << large->status;
  EXPECT_EQ(client.Get("/api/me")->status, 200);
}

TEST_F(PageServerTest, AFaultInAFileForACalibrationIsNamedWithItsLine) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto in = log_in("calibrate");
  auto client = browser();
  const auto fault = [&](const json& body) {
    const auto answer = client.Post("/api/calibrate", in.headers, body.dump(), "application/json");
    return answer ? answer->body : "no answer";
  };
  EXPECT_THAT(fault({{"method", "otf"},
                     {"path", {{"file", "p.csv"}, {"text", "x_mm,y_mm,z_mm\n0,0,0\n1,b,0\n"}}}}),
              HasSubstr("p.csv:3"));
  EXPECT_THAT(fault({{"method", "evemu"},
                     {"calibrator", {{"file", "c.toml"}, {"text", "[calibrator]\nname = 1\n"}}}}),
              HasSubstr("c.toml:2"));
  EXPECT_THAT(fault({{"method", "magic"}}), HasSubstr("must be otf, evemu or mfb"));
  EXPECT_THAT(fault(json::object()), HasSubstr("method"));
}

template <auto free>
struct Free {
  template <class T>
  void operator()(T* object) const {
    free(object);
  }
};

/// Writes a certificate for localhost that signs itself, and its key. `until`: as ASN.1 has it.
void write_certificate(const std::filesystem::path& folder, const char* until) {
  const std::unique_ptr<EVP_PKEY, Free<EVP_PKEY_free>> key{EVP_EC_gen("P-256")};
  const std::unique_ptr<X509, Free<X509_free>> certificate{X509_new()};
  X509_set_version(certificate.get(), X509_VERSION_3);
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -2L * 86400);
  ASSERT_EQ(ASN1_TIME_set_string(X509_getm_notAfter(certificate.get()), until), 1);
  X509_NAME* const name = X509_get_subject_name(certificate.get());
  const auto* const common_name = reinterpret_cast<const unsigned char*>("localhost");  // NOLINT
  X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC, common_name, -1, -1, 0);
  X509_set_issuer_name(certificate.get(), name);
  X509_set_pubkey(certificate.get(), key.get());
  ASSERT_GT(X509_sign(certificate.get(), key.get(), EVP_sha256()), 0);

  const std::unique_ptr<BIO, Free<BIO_free>> to{BIO_new_file((folder / "web.pem").c_str(), "w")},
      key_to{BIO_new_file((folder / "key.pem").c_str(), "w")};
  ASSERT_EQ(PEM_write_bio_X509(to.get(), certificate.get()), 1);
  ASSERT_EQ(
      PEM_write_bio_PrivateKey(key_to.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr), 1);
}

constexpr const char* kTls = "certificate = \"web.pem\"\nkey = \"key.pem\"\n";

struct RefusedCertificate : PageServerTest {
  /// Why a page over TLS does not start.
  [[nodiscard]] daemon::Error refusal() const {
    write_config(std::string{"port = 0\n"} + kTls);
    auto read = settings();
    if (!read) return read.error();
    const auto page = PageServer::start({.settings = std::move(*read),
                                         .config_file = folder_ / "abbed.toml",
                                         .report = [](const std::string&) {}});
    EXPECT_FALSE(page);
    return page ? daemon::Error{} : page.error();
  }
};

TEST_F(RefusedCertificate, IsNamedWithTheDateOfItsEnd) {
  write_certificate(folder_, "240229120000Z");
  EXPECT_THAT(refusal().text, HasSubstr("web.pem expired on 2024-02-29"));
}

TEST_F(RefusedCertificate, ThatIsMissingIsAFaultOfTheConfiguration) {
  const daemon::Error error = refusal();
  EXPECT_EQ(error.code, daemon::ErrorCode::BadInput);
  EXPECT_THAT(error.text, AllOf(HasSubstr("certificate: read "), HasSubstr("web.pem"),
                                HasSubstr("([web] certificate)")));
}

TEST_F(PageServerTest, ACertificateMayBeValidUntilTheYear9999) {
  write_certificate(folder_, "99991231235959Z");
  const auto dates = read_certificate(folder_ / "web.pem");
  ASSERT_TRUE(dates);
  EXPECT_EQ(day_of(dates->until), "9999-12-31");
  ASSERT_NO_FATAL_FAILURE(start(kTls));
  EXPECT_EQ(page_->fault(), "");
}

TEST(CertificateNotice, BeginsFourteenDaysBeforeTheEnd) {
  const auto until = std::chrono::sys_days{std::chrono::year{2026} / 11 / 15};
  EXPECT_EQ(certificate_notice("web.pem", until, until - 15 * 24h), "");
  EXPECT_EQ(certificate_notice("web.pem", until, until - 14 * 24h),
            "certificate web.pem expires on 2026-11-15: replace it and restart abbe-web");
  EXPECT_THAT(certificate_notice("web.pem", until, until), HasSubstr("expired on 2026-11-15"));
  const std::chrono::sys_days far = std::chrono::year{9999} / 12 / 31;
  EXPECT_EQ(certificate_notice("web.pem", far, until), "");
}

TEST_F(PageServerTest, ACertificateThatExpiresSoonIsANotice) {
  const auto soon = std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now()) + 48h;
  const std::chrono::year_month_day day{std::chrono::floor<std::chrono::days>(soon)};
  write_certificate(
      folder_, fmt::format("{:04}{:02}{:02}120000Z", static_cast<int>(day.year()),
                           static_cast<unsigned>(day.month()), static_cast<unsigned>(day.day()))
                   .c_str());
  ASSERT_NO_FATAL_FAILURE(start(kTls));
  EXPECT_THAT(page_->notice(), HasSubstr("web.pem expires on "));
  EXPECT_EQ(page_->fault(), "");
}

TEST_F(PageServerTest, AKeyThatOthersMayReadIsNamed) {
  write_certificate(folder_, "20991231235959Z");
  ::chmod((folder_ / "key.pem").c_str(), 0640);
  ASSERT_NO_FATAL_FAILURE(start(kTls));
  EXPECT_THAT(log(), Not(Contains(HasSubstr("key.pem"))));
  ::chmod((folder_ / "key.pem").c_str(), 0644);
  page_.reset();
  ASSERT_NO_FATAL_FAILURE(start(kTls));
  EXPECT_THAT(log(), Contains(AllOf(HasSubstr("key.pem: other users may read it"),
                                    HasSubstr("chmod 0640"))));
}

TEST_F(PageServerTest, ServesOverTls) {
  write_certificate(folder_, "20991231235959Z");
  ASSERT_NO_FATAL_FAILURE(start(kTls));
  httplib::SSLClient client{"127.0.0.1", page_->port()};
  client.enable_server_certificate_verification(false);
  const auto me = client.Get("/api/me");
  ASSERT_TRUE(me);
  EXPECT_EQ(me->status, 200);
  const auto in = client.Post("/api/login", json{{"user", "view"}, {"password", kPassword}}.dump(),
                              "application/json");
  ASSERT_TRUE(in);
  EXPECT_THAT(in->get_header_value("Set-Cookie"), HasSubstr("; Secure"));
}

}  // namespace
}  // namespace abbe::web
