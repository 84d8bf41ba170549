/// `abbe model` on a store of models: the built program, its output and exit codes.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe/model/model_store.hpp"
#include "abbe_command.hpp"
#include "synthetic_model.hpp"
#include "synthetic_otf_run.hpp"
#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using test::Ran;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class CliModelStore : public ::testing::Test {
 protected:
  [[nodiscard]] Ran abbe(const std::string& arguments) const {
    return test::run_abbe(folder_, arguments);
  }
  [[nodiscard]] fs::path write(const std::string& name, const std::string& text) const {
    test::write_text(folder_ / name, text);
    return folder_ / name;
  }

  TemporaryFolder temporary_;
  const fs::path& folder_ = temporary_.path();
};

TEST_F(CliModelStore, SaysThatAFolderIsNoModelStore) {
  const auto missing = abbe("model list --store nowhere");
  EXPECT_EQ(missing.exit, 4);
  EXPECT_THAT(missing.err, HasSubstr("nowhere: there is no such folder"));
  EXPECT_FALSE(fs::exists(folder_ / "nowhere"));

  fs::create_directories(folder_ / "empty");
  const auto empty = abbe("model list --store empty");
  EXPECT_EQ(empty.exit, 3);
  EXPECT_THAT(empty.err, HasSubstr("empty: is not a model store"));
  EXPECT_TRUE(fs::is_empty(folder_ / "empty"));
}

TEST_F(CliModelStore, SaysThatAStoreHasNoModelsAndNoActiveOne) {
  ASSERT_TRUE(ModelStore::open(folder_ / "new_store"));
  const auto list = abbe("model list --store new_store");
  EXPECT_EQ(list.exit, 0);
  EXPECT_THAT(list.out, HasSubstr("the store has no models"));

  const auto show = abbe("model show active --store new_store");
  EXPECT_EQ(show.exit, 5);
  EXPECT_THAT(show.err, HasSubstr("no model is active"));
}

TEST_F(CliModelStore, ActivateAsksForFourCharacters) {
  const auto folder = folder_ / "short_ids";
  auto store = ModelStore::open(folder).value();
  const auto id = store.add(test::synthetic_document(1), true, {}, {"test", "", {}}).value();
  const auto ran =
      abbe(fmt::format("model activate {} --store '{}'", id.substr(0, 3), folder.string()));
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("give at least 4 characters"), HasSubstr("  " + id)));
}

TEST_F(CliModelStore, ListsActivatesAndRollsBackModelsOfAStore) {
  const auto folder = folder_ / "store";
  auto store = ModelStore::open(folder).value();
  const auto a = store.add(test::synthetic_document(1), true, {}, {"test", "", {}}).value();
  const auto b =
      store.add(test::synthetic_document(2), false, {"no better"}, {"test", "", {}}).value();
  const auto at = fmt::format(" --store '{}'", folder.string());

  EXPECT_EQ(abbe("model activate " + a + at).exit, 0);
  EXPECT_EQ(abbe("model activate " + b + at).exit, 5);
  EXPECT_EQ(abbe("model activate " + b + at + " --force").exit, 2);
  EXPECT_EQ(abbe("model activate " + b + at + " --force --why checked-by-hand").exit, 0);
  EXPECT_EQ(nlohmann::json::parse(abbe("model list --json" + at).out).size(), 2u);
  EXPECT_THAT(abbe("model show active" + at).out,
              AllOf(HasSubstr(b), HasSubstr("forced"), HasSubstr("EXX,-300,")));
  EXPECT_EQ(abbe("model rollback" + at).exit, 0);
  EXPECT_EQ(ModelStore::open(folder).value().active_id().value(), a);
  EXPECT_EQ(abbe("model rollback" + at).exit, 5);

  const auto repeated = abbe("model rollback --active " + b + at);
  EXPECT_EQ(repeated.exit, 5);
  EXPECT_THAT(repeated.err, HasSubstr(b + " is not active (model " + a));
}

TEST_F(CliModelStore, TheConfigurationNamesTheStore) {
  const auto config =
      write("daemon.toml", test::synthetic_machine_toml() + "[daemon]\ndata_dir = \"data\"\n");
  auto store = ModelStore::open(folder_ / "data" / "models").value();
  const StoreActor actor{"tester", "test", {}};
  const auto id = store.add(test::synthetic_document(1), true, {}, actor).value();
  const auto activated = abbe(fmt::format("model activate {} -c '{}'", id, config.string()));
  EXPECT_EQ(activated.exit, 0) << activated.err;
  EXPECT_EQ(store.active_id().value(), id);
  EXPECT_THAT(abbe(fmt::format("model list -c '{}'", config.string())).out, HasSubstr(id));
}

TEST_F(CliModelStore, EvaluatesAModelOfTheStoreByItsNameThere) {
  const auto folder = folder_ / "evaluated";
  auto store = ModelStore::open(folder).value();
  const StoreActor actor{"tester", "test", {}};
  const auto id = store.add(test::synthetic_document(2), true, {}, actor).value();
  ASSERT_TRUE(store.activate(id, actor));
  const auto points = write("one_point.csv", "x_mm,y_mm,z_mm\n10,-20,-250\n");

  const auto eval = [&](const std::string& model) {
    return abbe(fmt::format("model eval '{}' --points '{}' --store '{}'", model, points.string(),
                            folder.string()));
  };

  const auto by_file = eval(store.model_path(id).string());
  ASSERT_EQ(by_file.exit, 0) << by_file.err;
  EXPECT_EQ(eval("active").out, by_file.out);
  EXPECT_EQ(eval(id.substr(0, 8)).out, by_file.out);
  EXPECT_EQ(eval("ffff").exit, 2);
}

/// A refused model as a file and in a store, and an accepted one.
class CliRefusedModel : public CliModelStore {
 protected:
  CliRefusedModel() {
    auto document = test::synthetic_document(1);
    (void)write("accepted.json", to_json(document));
    document.verdict = ModelVerdict{.reasons = {kReason}};
    (void)write("refused.json", to_json(document));
    document.verdict.reset();
    (void)write("earlier.json", to_json(document));
    (void)write("points.csv", "x_mm,y_mm,z_mm\n10,-20,-250\n");
    id_ = store().add(test::synthetic_document(2), false, {kReason}, {"test", "", {}}).value();
  }
  [[nodiscard]] ModelStore store() const { return ModelStore::open(folder_ / "store").value(); }

  static constexpr const char* kReason = "larger by 418 um/m";
  std::string id_;
};

TEST_F(CliRefusedModel, AddedIsKeptWithItsVerdictButNotActivated) {
  const auto accepted = abbe("model add accepted.json --store store --why 'measured in May'");
  EXPECT_EQ(accepted.exit, 0) << accepted.err;
  const auto document = read_model(folder_ / "accepted.json").value();
  EXPECT_THAT(accepted.out, AllOf(HasSubstr("added: " + model_id(document)),
                                  HasSubstr("next: abbe model activate " + model_id(document))));
  EXPECT_EQ(to_json(store().load(model_id(document)).value()), to_json(document));
  EXPECT_EQ(store().history().value().back().actor.why, "measured in May");
  EXPECT_EQ(store().active_id().value(), std::nullopt);

  auto other = test::synthetic_document(3);
  other.verdict = ModelVerdict{.reasons = {kReason}};
  (void)write("other.json", to_json(other));
  const auto refused = abbe("model add other.json --store store");
  EXPECT_EQ(refused.exit, 0) << refused.err;
  EXPECT_THAT(refused.out, AllOf(HasSubstr("added: "), HasSubstr(kReason),
                                 Not(HasSubstr("next: abbe model activate"))));
  EXPECT_EQ(store().list().value().size(), 3U);
}

TEST_F(CliRefusedModel, WithoutVerdictOrOfAnotherMachineIsNotAdded) {
  const auto unjudged = abbe("model add earlier.json --store store");
  EXPECT_EQ(unjudged.exit, 3);
  EXPECT_THAT(unjudged.err, HasSubstr("earlier.json: the gate has not judged this model"));

  auto machine = test::synthetic_machine_toml();
  machine.replace(machine.find("-120"), 4, "-121");
  (void)write("other.toml", machine + "[daemon]\ndata_dir = \"data\"\n");
  ASSERT_TRUE(ModelStore::open(folder_ / "data" / "models"));
  const auto other = abbe("model add accepted.json -c other.toml");
  EXPECT_EQ(other.exit, 5) << other.out;
  EXPECT_THAT(other.err, HasSubstr("add accepted.json: "));
  EXPECT_TRUE(ModelStore::open(folder_ / "data" / "models").value().list().value().empty());
}

TEST_F(CliRefusedModel, EvaluatedStatesItInTheOutputAndOnTheTerminal) {
  for (const std::string& model : {std::string{"refused.json"}, id_ + " --store store"}) {
    const auto ran = abbe("model eval " + model + " --points points.csv --correction");
    ASSERT_EQ(ran.exit, 0) << ran.err;
    EXPECT_THAT(ran.out, testing::StartsWith("# verdict: refused by the gate: larger by 418"));
    EXPECT_THAT(ran.err, HasSubstr("verdict: refused by the gate: larger by 418"));
  }
  EXPECT_THAT(abbe("model eval earlier.json --points points.csv").out,
              testing::StartsWith("# verdict: not judged"));
  EXPECT_THAT(abbe("model eval accepted.json --points points.csv").out,
              testing::StartsWith("# quantity = error"));
}

TEST_F(CliRefusedModel, ComparedStatesIt) {
  const auto ran = abbe("model compare accepted.json refused.json");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("B: verdict: refused by the gate: larger by 418"));
  const auto json =
      nlohmann::json::parse(abbe("model compare accepted.json refused.json --json").out);
  EXPECT_TRUE(json["cautions_a"].empty());
  EXPECT_THAT(json["cautions_b"].dump(), HasSubstr("larger by 418"));
}

TEST_F(CliRefusedModel, ShownFromAFileOrAStoreHasItsVerdict) {
  EXPECT_THAT(abbe("model show ./refused.json").out,
              HasSubstr("verdict     refused by the gate: larger by 418"));
  EXPECT_THAT(abbe("model show ./earlier.json").out, HasSubstr("verdict     not judged"));
  ASSERT_EQ(abbe("model activate " + id_ + " --store store --force --reason scrap").exit, 0);
  EXPECT_THAT(abbe("model show active --store store").out,
              AllOf(HasSubstr("active (forced)"), HasSubstr("forced by"), HasSubstr(": scrap")));
  const auto file = abbe("model show active --store store --json").out;
  const auto read = parse_model(file, "model.json");
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_EQ(state_of(read->verdict), VerdictState::Forced);
  EXPECT_EQ(read->verdict->forced->why, "scrap");
}

TEST_F(CliRefusedModel, AStoreOfAnEarlierVersionListsItAsNotJudgedWithoutItsState) {
  auto document = test::synthetic_document(2);
  document.verdict.reset();
  (void)write("store/models/" + id_ + ".json", to_json(document));
  fs::remove(folder_ / "store" / "state.json");
  EXPECT_THAT(abbe("model list --store store").out, HasSubstr("not judged"));
}

}  // namespace
}  // namespace abbe::daemon
