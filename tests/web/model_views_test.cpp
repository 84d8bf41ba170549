/// What the page shows of a store that other processes change.

#include "abbe/web/model_views.hpp"

#include <gmock/gmock.h>

#include <array>
#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/model/model_store.hpp"
#include "synthetic_model.hpp"
#include "web_folder.hpp"

namespace abbe::web {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

struct ModelViewsTest : test::WebFolder {
  std::string add(unsigned seed) { return add(daemon::test::synthetic_document(seed)); }
  std::string add(const daemon::ModelDocument& document) {
    auto store = daemon::ModelStore::open(folder_ / "models");
    const auto id = store->add(document, true, {}, {.who = "test", .why = "", .when = {}});
    EXPECT_TRUE(id);
    return id.value_or("");
  }
  ModelViews views_{folder_ / "models"};
};

TEST_F(ModelViewsTest, AModelFileThatIsDamagedIsReadAgain) {
  const std::string id = add(1);
  ASSERT_TRUE(views_.model(id));
  EXPECT_THAT(views_.history().value(), HasSubstr("\"fault\":\"\""));
  write("models/models/" + id + ".json", "{}");
  EXPECT_FALSE(views_.model(id));
  const auto history = nlohmann::json::parse(views_.history().value());
  EXPECT_NE(history["models"][0]["fault"], "");
}

TEST_F(ModelViewsTest, AModelThatIsAddedIsInHistoryAndTrend) {
  add(1);
  EXPECT_EQ(nlohmann::json::parse(views_.trend().value())["models"].size(), 1u);
  EXPECT_EQ(nlohmann::json::parse(views_.history().value())["models"].size(), 1u);
  add(2);
  EXPECT_EQ(nlohmann::json::parse(views_.trend().value())["models"].size(), 2u);
  EXPECT_EQ(nlohmann::json::parse(views_.history().value())["models"].size(), 2u);
}

TEST_F(ModelViewsTest, TheHistoryHasTheNewestModelsAndTheActiveOne) {
  std::vector<std::string> ids;
  for (unsigned seed = 1; seed <= 6; ++seed) ids.push_back(add(seed));
  auto store = daemon::ModelStore::open(folder_ / "models");
  ASSERT_TRUE(store->activate(ids.front(), {.who = "anna", .why = "", .when = {}}));
  ModelViews few{folder_ / "models", {}, 3};
  const auto history = nlohmann::json::parse(few.history().value());
  std::vector<std::string> listed;
  for (const auto& model : history["models"]) listed.push_back(model["id"]);
  EXPECT_THAT(listed, ElementsAre(ids[5], ids[4], ids[3], ids[0]));
  EXPECT_EQ(history["left_out"], 2);
  EXPECT_EQ(nlohmann::json::parse(views_.history().value())["left_out"], 0);
}

TEST_F(ModelViewsTest, AModelIsShownWithItsVerdictAndTheEventsThatCameLater) {
  auto store = daemon::ModelStore::open(folder_ / "models");
  const daemon::StoreActor anna{.who = "anna", .why = "step gauge passed", .when = {}};
  const auto id =
      store->add(daemon::test::synthetic_document(1), false, {"held-out rms 9 um"}, anna);
  ASSERT_TRUE(id);
  const auto before = nlohmann::json::parse(views_.model(*id).value())["verdict"];
  EXPECT_EQ(before["lamp"], "red");
  EXPECT_EQ(before["reasons"][0], "held-out rms 9 um");
  ASSERT_TRUE(store->activate(*id, anna, true));
  const auto after = nlohmann::json::parse(views_.model(*id).value())["verdict"];
  EXPECT_THAT(after["text"], HasSubstr("It is the active model"));
  EXPECT_THAT(after["notes"].dump(), HasSubstr("activated against the verdict by anna"));
  EXPECT_EQ(after["reasons"], before["reasons"]);
}

TEST_F(ModelViewsTest, TheLampIsYellowAfterALaterRunFoundDrift) {
  auto store = daemon::ModelStore::open(folder_ / "models");
  const daemon::StoreActor anna{.who = "anna", .why = "", .when = {}};
  const auto id = store->add(daemon::test::synthetic_document(1), true, {}, anna);
  ASSERT_TRUE(id && store->activate(*id, anna));
  const auto before = nlohmann::json::parse(views_.model(*id).value())["verdict"];
  ASSERT_TRUE(store->add_drift(*id, {.who = "abbed", .why = "EXX by 4 um", .when = {}}));
  const auto after = nlohmann::json::parse(views_.model(*id).value())["verdict"];
  EXPECT_EQ(before["lamp"], "green");
  EXPECT_EQ(after["lamp"], "yellow");
  EXPECT_THAT(after["notes"].dump(), HasSubstr("a later run found drift: abbed"));
}

TEST_F(ModelViewsTest, ADownloadedModelHasTheVerdictAndWhoForcedIt) {
  auto store = daemon::ModelStore::open(folder_ / "models");
  const daemon::StoreActor anna{.who = "anna", .why = "step gauge passed", .when = {}};
  const auto id =
      store->add(daemon::test::synthetic_document(1), false, {"held-out rms 9 um"}, anna);
  ASSERT_TRUE(id);
  const auto before = daemon::parse_model(views_.model_file(*id).value(), "model.json");
  ASSERT_TRUE(before) << before.error().text;
  EXPECT_EQ(before->verdict->reasons, std::vector<std::string>{"held-out rms 9 um"});
  ASSERT_TRUE(store->activate(*id, anna, true));
  const auto after = daemon::parse_model(views_.model_file(*id).value(), "model.json");
  ASSERT_TRUE(after) << after.error().text;
  EXPECT_EQ(after->verdict->forced, anna);
  EXPECT_EQ(daemon::model_id(*after), *id);
}

TEST_F(ModelViewsTest, AModelOfAnotherMachineConfigurationIsYellow) {
  const std::string id = add(1);
  const auto hash = daemon::test::synthetic_document(1).machine_hash;
  ModelViews own{folder_ / "models", hash}, other{folder_ / "models", "another"};
  EXPECT_EQ(nlohmann::json::parse(own.model(id).value())["verdict"]["lamp"], "green");
  const auto seen = nlohmann::json::parse(other.model(id).value())["verdict"];
  EXPECT_EQ(seen["lamp"], "yellow");
  EXPECT_THAT(seen["notes"].dump(), HasSubstr("STALE"));
  EXPECT_THAT(other.report(id).value(), HasSubstr("made for another machine configuration"));
}

TEST_F(ModelViewsTest, TheTrendHasEachTableOfTheNewestModels) {
  for (unsigned seed = 1; seed <= 8; ++seed) add(seed);
  const auto trend = nlohmann::json::parse(views_.trend().value());
  EXPECT_EQ(trend["models"].size(), 8u);
  ASSERT_FALSE(trend["tables"].empty());
  for (const auto& table : trend["tables"]) {
    ASSERT_EQ(table["curves"].size(), 6u) << table["name"];
    EXPECT_EQ(table["curves"].back()["model"], 7);
    EXPECT_EQ(table["curves"][0]["u"].size(), table["curves"][0]["x"].size());
  }
  for (const auto& value : trend["values"]) EXPECT_NE(value["group"], "");
}

/// Measured in the hour that ends at `hour`.
daemon::ModelDocument measured_until(int hour, unsigned seed) {
  const auto at = [](int h) { return protocol::UtcTime{std::chrono::hours{h}}; };
  auto document = daemon::test::synthetic_document(seed);
  document.run.emplace().conditions.emplace().measured = std::array{at(hour - 1), at(hour)};
  return document;
}

TEST_F(ModelViewsTest, TheTrendIsInTheOrderOfTheMeasurements) {
  constexpr int kFirst = 480000;  // since 1970
  std::vector<std::string> ids;
  for (unsigned i = 0; i < 8; ++i)
    ids.push_back(add(measured_until(kFirst - 24 * static_cast<int>(i), i + 1)));
  const auto trend = nlohmann::json::parse(views_.trend().value());
  ASSERT_EQ(trend["models"].size(), 8u);
  EXPECT_EQ(trend["models"][0]["id"], ids.back()) << "added last, measured first";
  EXPECT_EQ(trend["models"][7]["id"], ids.front());
  EXPECT_EQ(trend["models"][7]["measured"].get<std::string>().substr(0, 13), "2024-10-04T00");
  const auto& curves = trend["tables"][0]["curves"];
  ASSERT_EQ(curves.size(), 6u);
  EXPECT_EQ(curves[0]["model"], 2) << "the oldest of the newest six";
}

TEST_F(ModelViewsTest, EachCurveNamesItsErrorMotion) {
  const auto model = nlohmann::json::parse(views_.model(add(1)).value());
  EXPECT_EQ(model["charts"][0]["curves"][0]["key"], "EXX");
}

TEST_F(ModelViewsTest, AReportHasTheEventsThatCameLater) {
  const std::string id = add(1);
  const std::string before = views_.report(id).value();
  auto store = daemon::ModelStore::open(folder_ / "models");
  ASSERT_TRUE(store->activate(id, {.who = "anna", .why = "step gauge passed", .when = {}}));
  const std::string after = views_.report(id).value();
  EXPECT_THAT(before, Not(HasSubstr("step gauge passed")));
  EXPECT_THAT(after, HasSubstr("step gauge passed"));
}

TEST_F(ModelViewsTest, AtTheEndNothingMoreIsMade) {
  const std::string kept = add(1), other = add(2);
  ASSERT_TRUE(views_.model(kept));
  views_.stop();
  EXPECT_TRUE(views_.model(kept));
  EXPECT_FALSE(views_.model(other));
}

TEST_F(ModelViewsTest, ShowsMoreModelsThanItKeeps) {
  std::vector<std::string> ids;
  for (unsigned seed = 1; seed <= 14; ++seed) ids.push_back(add(seed));
  for (int i = 0; i < 2; ++i)
    for (const std::string& id : ids)
      EXPECT_EQ(nlohmann::json::parse(views_.model(id).value())["id"], id);
}

}  // namespace
}  // namespace abbe::web
