/// A recorded run identified again by the page: with which options, what ends it, who may begin it,
/// and how the model comes into the store.

#include "abbe/web/identifications.hpp"

#include <httplib.h>

#undef _res  // a macro of resolv.h, which changes headers of Eigen

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "abbe/base/control_protocol.hpp"
#include "abbe/model/model_document.hpp"
#include "page_fixture.hpp"
#include "synthetic_otf_recording.hpp"

namespace abbe::web {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using daemon::ErrorCode;
using nlohmann::json;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

/// An identification may end before a test that wants to see it run asks again.
constexpr int kMostAnswers = 20;

/// The configuration of the recording with limits that no model keeps.
std::string strict_toml() {
  return daemon::test::synthetic_recorded_toml() + "[gate]\nmax_error_mm = 1e-6\n";
}

class IdentificationsTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("abbe-identifications-{}", ::getpid());
    name_ = daemon::test::record_synthetic_run(folder_).filename();
    std::ofstream{folder_ / "strict.toml"} << strict_toml();
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static std::unique_ptr<Identifications> identifications(TaskLimits limits = {}) {
    return std::make_unique<Identifications>(
        IdentificationFiles{.recordings = folder_,
                            .models = folder_ / "no store",
                            .config_file = folder_ / "strict.toml"},
        [](const std::string& line) { ADD_FAILURE() << line; }, limits);
  }
  static json body(json more = json::object()) {
    more.update({{"name", name_}, {"method", "otf"}});
    return more;
  }
  static json end_of(const Identifications& page) {
    json status = page.status();
    for (; status["state"] == "running"; status = page.status()) std::this_thread::sleep_for(1ms);
    return status;
  }
  static json outcome_of(Identifications& page, json more = json::object()) {
    const auto begun = page.begin(body(std::move(more)), "anna");
    EXPECT_TRUE(begun) << begun.error().text;
    return end_of(page);
  }

  static inline fs::path folder_;
  static inline std::string name_;
};

TEST_F(IdentificationsTest, ARunIsIdentifiedWithItsOptionsAndAccepted) {
  const auto page = identifications();
  EXPECT_EQ(page->status()["state"], "none");
  const json outcome = outcome_of(*page, {{"backlash", "none"}, {"smoothness_um", ""}});
  ASSERT_EQ(outcome["state"], "done") << outcome;
  EXPECT_EQ(outcome["options"], json::array({"backlash none"}));
  EXPECT_EQ(outcome["result"]["accepted"], true) << outcome;
  EXPECT_EQ(outcome["result"]["added"], false);
  EXPECT_THAT(outcome["result"]["figures"].get<std::string>(), HasSubstr("without compensation"));

  const auto model = page->model(outcome["result"]["id"]);
  ASSERT_TRUE(model) << model.error().text;
  EXPECT_EQ(model->from, "identified again from " + name_ + ": backlash none");
  const auto document = daemon::parse_model(model->text, "model.json");
  ASSERT_TRUE(document) << document.error().text;
  EXPECT_EQ(model_id(*document), model->id);
  EXPECT_TRUE(document->verdict->accepted);
}

TEST_F(IdentificationsTest, ThePresentConfigurationRefusesWithItsReason) {
  const auto page = identifications();
  const json outcome = outcome_of(*page, {{"configuration", "present"}});
  ASSERT_EQ(outcome["state"], "done") << outcome;
  EXPECT_EQ(outcome["result"]["accepted"], false);
  EXPECT_FALSE(outcome["result"]["reasons"].empty());
  const auto document = daemon::parse_model(page->model()->text, "model.json");
  ASSERT_TRUE(document) << document.error().text;
  EXPECT_FALSE(document->verdict->accepted);
}

TEST_F(IdentificationsTest, WhoAcceptsAConditionIsInTheVerdict) {
  const auto page = identifications();
  const json outcome = outcome_of(*page, {{"accept", {"path-orientation"}}});
  ASSERT_EQ(outcome["state"], "done") << outcome;
  EXPECT_THAT(outcome["result"]["notes"].get<std::vector<std::string>>(),
              Contains("anna accepted for this model: path-orientation"));
}

TEST_F(IdentificationsTest, WrongInputIsNamed) {
  const auto page = identifications();
  const auto fault = [&](json more) {
    const auto begun = page->begin(body(std::move(more)), "anna");
    return begun ? std::string{} : begun.error().text;
  };
  EXPECT_THAT(fault({{"tables", "round"}}), HasSubstr("must be linear, cubic, not-a-knot-cubic"));
  EXPECT_THAT(fault({{"accept", {"everything"}}}), HasSubstr("must be evemu-shape-only"));
  EXPECT_THAT(fault({{"order", 3}}), HasSubstr("\"order\" is no option of method otf"));
  const auto other = [&](const json& request) { return page->begin(request, "anna").error(); };
  EXPECT_THAT(other({{"name", name_}, {"method", "magic"}}).text, HasSubstr("otf, evemu or mfb"));
  EXPECT_THAT(other({{"name", name_}, {"method", "evemu"}, {"order", 2.5}}).text,
              HasSubstr("whole number, 1 to 5"));
  EXPECT_EQ(other({{"name", "gone.mcap"}, {"method", "otf"}}).code, ErrorCode::Io);
  EXPECT_EQ(other({{"name", "../strict.toml"}, {"method", "otf"}}).code, ErrorCode::Usage);
  EXPECT_EQ(page->status()["state"], "none");
}

TEST_F(IdentificationsTest, AFaultThatTheTaskFindsIsItsFailure) {
  const auto page = identifications();
  const json rough = outcome_of(*page, {{"smoothness_um", "much"}});
  EXPECT_EQ(rough["state"], "failed");
  EXPECT_THAT(rough.value("error", ""), HasSubstr("0.01 to 1000"));
  ASSERT_TRUE(page->begin({{"name", name_}, {"method", "mfb"}}, "anna"));
  EXPECT_THAT(end_of(*page).value("error", ""), HasSubstr("contains no complete calibration"));
  EXPECT_FALSE(page->model());
}

TEST_F(IdentificationsTest, ASecondOneIsRefusedUntilTheFirstHasEnded) {
  const auto page = identifications();
  daemon::Result<void> second;
  for (int i = 0; second && i < kMostAnswers; ++i) {
    (void)outcome_of(*page);
    ASSERT_TRUE(page->begin(body(), "anna"));
    second = page->begin(body(), "bert");
  }
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Refused);
  EXPECT_THAT(second.error().text, HasSubstr("another identification is running"));
  const json outcome = end_of(*page);
  EXPECT_EQ(outcome["state"], "done");
  EXPECT_EQ(outcome["user"], "anna");
}

TEST_F(IdentificationsTest, CancellingEndsItAndTheNextOneRuns) {
  const auto page = identifications();
  EXPECT_EQ(page->cancel("anna").error().code, ErrorCode::Refused);
  json outcome;
  for (int i = 0; outcome["state"] != "failed" && i < kMostAnswers; ++i) {
    ASSERT_TRUE(page->begin(body(), "anna"));
    (void)page->cancel("bert");
    outcome = end_of(*page);
  }
  EXPECT_EQ(outcome.value("error", ""), "cancelled by bert");
  EXPECT_EQ(outcome_of(*page)["state"], "done");
}

TEST_F(IdentificationsTest, ItEndsAtItsLimitsAndWhenThePageStops) {
  EXPECT_THAT(outcome_of(*identifications({.time = 0min})).value("error", ""),
              HasSubstr("took longer than 0 min"));
  EXPECT_THAT(outcome_of(*identifications({.memory_bytes = 1})).value("error", ""),
              HasSubstr("more than 0 MiB of memory"));
  const auto page = identifications();
  page->stop();
  EXPECT_THAT(outcome_of(*page).value("error", ""), HasSubstr("abbe-web stops"));
}

struct IdentifyPage : test::PageFixture {
  void start_with_recording() {
    ASSERT_NO_FATAL_FAILURE(start());
    name_ = daemon::test::record_synthetic_run(folder_ / "data/recordings").filename();
    in_ = log_in("calibrate").headers;
  }
  [[nodiscard]] json status() const {
    const auto answer = browser().Get("/api/identify");
    return answer ? json::parse(answer->body) : json::object();
  }
  [[nodiscard]] json end() const {
    json seen = status();
    for (; seen["state"] == "running"; seen = status()) std::this_thread::sleep_for(100ms);
    return seen;
  }
  [[nodiscard]] json request() const { return {{"name", name_}, {"method", "otf"}}; }
  /// abbed, as far as it adds models.
  void start_abbed() {
    fs::create_directories(folder_ / "run");
    auto server = daemon::ControlServer::open(
        folder_ / "run/control.sock", [this](const json& asked, const daemon::ControlPeer&) {
          if (asked["do"] != "add")
            return daemon::refusal({ErrorCode::Refused, "not in this test"});
          const auto document = daemon::parse_model(asked["model"].get<std::string>(), "model");
          if (!document) return daemon::refusal(document.error());
          auto store = daemon::ModelStore::open(folder_ / "data/models");
          const auto id =
              store->add(*document, document->verdict->accepted, document->verdict->reasons,
                         {asked["who"].get<std::string>(), asked["why"], {}});
          return id ? json{{"ok", true}, {"change", 1}, {"id", *id}} : daemon::refusal(id.error());
        });
    ASSERT_TRUE(server) << server.error().text;
    abbed_ = std::move(*server);
  }

  std::string name_;
  httplib::Headers in_;
  std::unique_ptr<daemon::ControlServer> abbed_;
};

TEST_F(IdentifyPage, NeedsTheRoleCalibrate) {
  ASSERT_NO_FATAL_FAILURE(start_with_recording());
  const auto view = log_in("view").headers;
  for (const char* path : {"/api/identify", "/api/cancelidentification", "/api/addidentified"}) {
    EXPECT_EQ(post({}, path, request()), 401) << path;
    EXPECT_EQ(post(view, path, request()), 403) << path;
  }
  EXPECT_EQ(status()["state"], "none");
  EXPECT_EQ(browser().Get("/identified/model.json")->status, 404);
  EXPECT_EQ(post(in_, "/api/cancelidentification", json::object()), 409);
  EXPECT_EQ(post(in_, "/api/addidentified", {{"id", "0123456789abcdef"}}), 409);
  EXPECT_EQ(post(in_, "/api/identify", {{"name", name_}}), 400);
}

TEST_F(IdentifyPage, AnAcceptedModelIsAddedToTheStoreAndNotActivated) {
  ASSERT_NO_FATAL_FAILURE(start_with_recording());
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  EXPECT_EQ(post(in_, "/api/identify", request()), 200);
  const json done = end();
  ASSERT_EQ(done["state"], "done") << done;
  const auto file = browser().Get("/identified/model.json");
  EXPECT_EQ(model_id(daemon::parse_model(file->body, "model.json").value()), done["result"]["id"]);

  EXPECT_EQ(post(in_, "/api/addidentified", {{"id", "another"}}), 409);
  EXPECT_EQ(post(in_, "/api/addidentified", {{"id", done["result"]["id"]}}), 200);
  EXPECT_EQ(status()["result"]["added"], true);
  const auto store = daemon::ModelStore::open(folder_ / "data/models");
  const auto entries = store->list();
  ASSERT_EQ(entries->size(), 1u);
  EXPECT_TRUE(entries->front().accepted);
  EXPECT_FALSE(entries->front().active);
  EXPECT_EQ(store->history()->back().actor.why, "identified again from " + name_);
  EXPECT_THAT(log(), Contains(HasSubstr("calibrate: add: done")));
}

TEST_F(IdentifyPage, ARefusedModelIsAddedAsRefused) {
  ASSERT_NO_FATAL_FAILURE(start_with_recording());
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  write("abbed.toml", strict_toml());
  json present = request();
  present["configuration"] = "present";
  EXPECT_EQ(post(in_, "/api/identify", present), 200);
  const json done = end();
  ASSERT_EQ(done["state"], "done") << done;
  EXPECT_EQ(post(in_, "/api/addidentified", {{"id", done["result"]["id"]}}), 200);
  const auto entries = daemon::ModelStore::open(folder_ / "data/models")->list();
  ASSERT_EQ(entries->size(), 1u);
  EXPECT_FALSE(entries->front().accepted);
  EXPECT_FALSE(entries->front().reasons.empty());
}

TEST_F(IdentifyPage, WithoutAbbedNothingIsAdded) {
  ASSERT_NO_FATAL_FAILURE(start_with_recording());
  EXPECT_EQ(post(in_, "/api/identify", request()), 200);
  const json done = end();
  ASSERT_EQ(done["state"], "done") << done;
  EXPECT_EQ(post(in_, "/api/addidentified", {{"id", done["result"]["id"]}}), 503);
  EXPECT_EQ(status()["result"]["added"], false);
}

TEST_F(IdentifyPage, RunsBesideNoReplay) {
  ASSERT_NO_FATAL_FAILURE(start_with_recording());
  int status = 200;
  for (int i = 0; status == 200 && i < kMostAnswers; ++i) {
    (void)end();
    EXPECT_EQ(post(in_, "/api/identify", request()), 200);
    status = post(in_, "/api/replay", {{"name", name_}});
    json seen = json::parse(browser().Get("/api/replay")->body);
    for (; seen["state"] == "running"; seen = json::parse(browser().Get("/api/replay")->body))
      std::this_thread::sleep_for(100ms);
  }
  EXPECT_EQ(status, 409);
}

TEST_F(IdentifyPage, EndsWhileAnIdentificationRuns) {
  ASSERT_NO_FATAL_FAILURE(start_with_recording());
  EXPECT_EQ(post(in_, "/api/identify", request()), 200);
  page_.reset();
  EXPECT_THAT(log(), Not(Contains(HasSubstr("internal error"))));
}

}  // namespace
}  // namespace abbe::web
