/// abbe-web beside abbed: what a user changes in a browser, and what the store then says of it.

#include <httplib.h>

#undef _res  // a macro of resolv.h, which changes headers of Eigen

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <memory>

#include "abbe/model/model_store.hpp"
#include "spine.hpp"
#include "synthetic_model.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

constexpr const char* kWebPassword = "a long password";

struct Web : Spine {
  /// No device answers; the store has an accepted model, an active one, and a refused one.
  void start_everything() {
    tracker_port_ = 1;
    can_port_ = 1;
    write_configuration();
    write("password", std::string{kWebPassword} + "\n");
    const auto user = run({"/bin/sh", "-c",
                           fmt::format("{} --hash-password anna --role administer <{}",
                                       ABBE_WEB_PROGRAM, file("password"))});
    ASSERT_EQ(user.code, 0) << user.err;
    write("users", user.out);
    ::chmod(file("users").c_str(), 0640);
    write("abbed.toml", text_of(file("abbed.toml")) + "[web]\nport = 0\nusers = \"users\"\n");
    fill_store();
    ASSERT_NO_FATAL_FAILURE(start_abbed());
    web_ = start({ABBE_WEB_PROGRAM, "--config", file("abbed.toml")}, "web");
    ASSERT_TRUE(eventually([this] { return !port_of_page().empty() || !web_->running(); }));
    ASSERT_TRUE(web_->running()) << web_->err();
  }

  void fill_store() {
    auto store = daemon::ModelStore::open(file("data/models"));
    ASSERT_TRUE(store);
    const daemon::StoreActor actor{.who = "test", .why = "", .when = {}};
    for (const unsigned seed : {1u, 2u, 3u}) {
      const auto id = store->add(daemon::test::synthetic_document(seed), seed < 3, {}, actor);
      ASSERT_TRUE(id) << id.error().text;
      if (seed < 3) {
        ASSERT_TRUE(store->activate(*id, actor));
      }
      ids_.push_back(*id);
    }
  }

  [[nodiscard]] std::string port_of_page() const {
    const std::string log = web_->err();
    const auto line = log.find("serving http://127.0.0.1:");
    if (line == std::string::npos) return {};
    const auto begin = log.find_last_of(':', log.find("/\n", line)) + 1;
    return log.substr(begin, log.find('/', begin) - begin);
  }
  void log_in() {
    client_ = std::make_unique<httplib::Client>("127.0.0.1", std::stoi(port_of_page()));
    const auto answer =
        client_->Post("/api/login", json{{"user", "anna"}, {"password", kWebPassword}}.dump(),
                      "application/json");
    ASSERT_TRUE(answer);
    ASSERT_EQ(answer->status, 200) << answer->body;
    const std::string cookie = answer->get_header_value("Set-Cookie");
    client_->set_default_headers(
        {{"Cookie", cookie.substr(0, cookie.find(';'))},
         {"X-CSRF-Token", json::parse(answer->body)["csrf"].get<std::string>()}});
  }
  [[nodiscard]] json post(const std::string& path, const json& body) {
    const auto answer = client_->Post(path, body.dump(), "application/json");
    return answer ? json{{"status", answer->status}, {"body", json::parse(answer->body)}} : json{};
  }

  std::vector<std::string> ids_;
  std::unique_ptr<Program> web_;
  std::unique_ptr<httplib::Client> client_;
};

TEST_F(Web, AUserActivatesAndRollsBackAndTheStoreNamesTheUser) {
  ASSERT_NO_FATAL_FAILURE(start_everything());
  ASSERT_NO_FATAL_FAILURE(log_in());
  const auto back = post("/api/rollback", {{"active", ids_[1]}, {"why", "a crash"}});
  EXPECT_EQ(back["status"], 200) << back;
  EXPECT_EQ(back["body"]["id"], ids_[0]);
  // The browser repeats a request whose answer was lost.
  EXPECT_EQ(post("/api/rollback", {{"active", ids_[1]}, {"why", "a crash"}})["status"], 409);
  const auto refused = post("/api/activate", {{"id", ids_[2]}, {"why", "try"}});
  EXPECT_EQ(refused["status"], 409) << refused;
  const auto forced = post("/api/activate", {{"id", ids_[2]}, {"force", true}});
  EXPECT_EQ(forced["status"], 400) << forced;
  EXPECT_THAT(forced["body"]["error"].get<std::string>(), HasSubstr("needs \"why\""));

  const auto events = daemon::ModelStore{file("data/models")}.history();
  ASSERT_TRUE(events);
  EXPECT_EQ(events->back().id, ids_[0]);
  EXPECT_EQ(events->back().actor.why, "a crash");
  EXPECT_THAT(events->back().actor.who, HasSubstr("(as anna)"));
  EXPECT_THAT(web_->err(), HasSubstr("anna: rollback: done"));
  EXPECT_TRUE(eventually([this] { return status()["model"]["id"] == ids_[0]; }));
}

TEST_F(Web, ShowsTheModelsOfTheStoreWithTheirReport) {
  ASSERT_NO_FATAL_FAILURE(start_everything());
  ASSERT_NO_FATAL_FAILURE(log_in());
  const auto history = json::parse(client_->Get("/api/history")->body);
  ASSERT_EQ(history["models"].size(), 3u) << history.dump(1);
  const auto model = json::parse(client_->Get("/api/models/active")->body);
  EXPECT_EQ(model["id"], ids_[1]);
  EXPECT_EQ(model["charts"].size(), 5u);  // with one tool no angular errors of Z are determined
  EXPECT_GT(model["field"]["vectors"].size(), 100u);
  EXPECT_FALSE(model["not_estimable"].empty());
  const auto report = client_->Get("/reports/" + ids_[1]);
  EXPECT_EQ(report->status, 200);
  EXPECT_THAT(report->get_header_value("Content-Security-Policy"), HasSubstr("sandbox"));
  EXPECT_EQ(client_->Get("/api/models/0000")->status, 400);
  EXPECT_EQ(json::parse(client_->Get("/api/trend")->body)["models"].size(), 2u);
}

}  // namespace
}  // namespace abbe::test
