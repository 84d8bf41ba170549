// What stands against the use of a model, and the verdict that travels with it.
#include "abbe/model/model_use.hpp"

#include <gmock/gmock.h>

#include <filesystem>

#include "abbe/model/stored_model.hpp"
#include "synthetic_model.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

using test::synthetic_document;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const protocol::UtcTime kNoon{std::chrono::hours{24 * 365 + 12}};

ModelVerdict refused_verdict() {
  return {.reasons = {"larger by \"418\" um/m", "held out: no better"}, .notes = {"dry air"}};
}

ModelDocument judged_document(std::optional<ModelVerdict> verdict) {
  ModelDocument document = synthetic_document(3);
  document.verdict = std::move(verdict);
  return document;
}

StoreEvent event_of(const ModelDocument& document, StoreAction action, std::string why) {
  return {.action = action, .id = model_id(document), .actor = {"foreman", std::move(why), kNoon}};
}

TEST(ModelVerdict, IsKeptInTheFileAndNotInTheHash) {
  ModelVerdict forced = refused_verdict();
  forced.forced = StoreActor{"foreman", "parts are waiting", kNoon};
  for (const auto& verdict : {refused_verdict(), forced, ModelVerdict{.accepted = true}}) {
    const ModelDocument document = judged_document(verdict);
    const auto read = parse_model(to_json(document), "model.json");
    ASSERT_TRUE(read) << read.error().text << read.error().details.front();
    EXPECT_EQ(read->verdict, verdict);
    EXPECT_EQ(to_json(*read), to_json(document));
    EXPECT_EQ(model_hash(*read), model_hash(judged_document({})));
  }
  EXPECT_FALSE(parse_model(to_json(judged_document({})), "model.json")->verdict);
}

TEST(ModelVerdict, OfInvalidUtf8IsReadAgain) {
  const auto text = to_json(judged_document(ModelVerdict{.reasons = {"file \xfc.csv"}}));
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << read.error().details.front();
  EXPECT_EQ(to_json(*read), text);
}

TEST(ModelVerdict, ThatWasEditedIsAFaultOfTheFile) {
  const std::string text = to_json(judged_document(refused_verdict()));
  for (const auto& [what, with] :
       {std::pair{"\"refused\"", "\"accepted\""}, std::pair{"no better", "better"},
        std::pair{"dry air", "moist air"}, std::pair{"\"sha256\": \"", "\"sha256\": \"0"},
        std::pair{"\"state\": \"refused\"", "\"state\": 1"},
        std::pair{"\"reasons\": [", "\"reasons\": [1, "}}) {
    std::string edited = text;
    const auto at = edited.find(what, edited.find("\"verdict\""));
    ASSERT_NE(at, std::string::npos) << what;
    const auto read =
        parse_model(edited.replace(at, std::string_view{what}.size(), with), "model.json");
    ASSERT_FALSE(read) << with;
    EXPECT_THAT(read.error().details.front(), HasSubstr("verdict")) << with;
  }
}

TEST(ModelVerdict, OfAnotherModelDoesNotFit) {
  ModelDocument other = synthetic_document(4);
  other.verdict = ModelVerdict{.accepted = true};
  const auto member = [](const std::string& text) {
    const auto from = text.find("\"verdict\"");
    return text.substr(from, text.find("\"chain\"") - from);
  };
  std::string text = to_json(judged_document(refused_verdict()));
  const std::string refused = member(text), accepted = member(to_json(other));
  EXPECT_FALSE(parse_model(text.replace(text.find(refused), refused.size(), accepted), "m.json"));
}

TEST(ModelUse, ARefusedModelIsRefusedForControlAndCertificateWithAllReasons) {
  const ModelDocument document = judged_document(refused_verdict());
  for (const auto purpose : {ModelPurpose::Control, ModelPurpose::Certificate}) {
    const auto found = obstacles_to_use({.document = document, .purpose = purpose});
    EXPECT_THAT(found.refusals,
                ElementsAre("verdict: refused by the gate: larger by \"418\" um/m; held out: no "
                            "better"));
    const auto stated = statements_of_use("export m.json", found, std::nullopt);
    ASSERT_FALSE(stated);
    EXPECT_EQ(stated.error().code, ErrorCode::Refused);
    EXPECT_THAT(stated.error().text, HasSubstr("export m.json: "));
    EXPECT_EQ(stated.error().details, found.refusals);
  }
}

TEST(ModelUse, AForcedUseStatesTheRefusalWhoForcedItAndWhy) {
  const ModelDocument document = judged_document(refused_verdict());
  const auto stated = statements_of_use("export", obstacles_to_use({.document = document}),
                                        StoreActor{"anna", "for a\ntest", kNoon});
  ASSERT_TRUE(stated);
  EXPECT_THAT(*stated, ElementsAre(HasSubstr("refused by the gate: larger"),
                                   "USED NEVERTHELESS, forced by anna, "
                                   "1971-01-01T12:00:00.000000000Z (UTC): for a test"));
}

TEST(ModelUse, NoStatementHasAControlCharacter) {
  const auto found =
      obstacles_to_use({.document = judged_document(ModelVerdict{.reasons = {"a\x1b[2Jb\n"}})});
  EXPECT_THAT(found.refusals, ElementsAre(HasSubstr("a\\u{1B}[2Jb ")));
}

TEST(ModelUse, AModelOfAnEarlierVersionStatesThatItWasNotJudged) {
  const auto found = obstacles_to_use({.document = judged_document({})});
  EXPECT_THAT(found.refusals, IsEmpty());
  EXPECT_THAT(found.statements, ElementsAre(HasSubstr("verdict: not judged")));
}

TEST(ModelUse, AnAcceptedModelStatesItsVerdictAndItsGap) {
  ModelDocument document = judged_document(ModelVerdict{.accepted = true});
  document.recording_gap = "the disk was full";
  const auto found = obstacles_to_use({.document = document});
  EXPECT_THAT(found.refusals, IsEmpty());
  EXPECT_THAT(found.statements, ElementsAre("verdict: accepted by the gate",
                                            cannot_be_checked(document.recording_gap)));
}

ModelDocument simulated_document() {
  ModelDocument document = judged_document(ModelVerdict{.accepted = true});
  document.configuration.emplace();
  set_entry(document.configuration->readings, "daemon.simulated", "true");
  document.machine_hash = hash_of(document.configuration->readings);
  return document;
}

TEST(ModelUse, OfSimulatedDevicesNoCertificateIsMadeAndEveryFileStatesIt) {
  const ModelDocument document = simulated_document();
  const auto certificate =
      obstacles_to_use({.document = document, .purpose = ModelPurpose::Certificate});
  EXPECT_THAT(certificate.refusals, ElementsAre(HasSubstr("SIMULATED")));
  for (const auto purpose : {ModelPurpose::Control, ModelPurpose::Look}) {
    const auto found = obstacles_to_use({.document = document, .purpose = purpose});
    EXPECT_THAT(found.refusals, IsEmpty());
    EXPECT_THAT(found.statements, ElementsAre(HasSubstr("accepted"), HasSubstr("SIMULATED")));
  }
}

TEST(ModelUse, AModelOfAnEarlierVersionIsNotStaleWhereItWasAccepted) {
  const ModelDocument document = judged_document(ModelVerdict{.accepted = true});
  StoreEvent accepted = event_of(document, StoreAction::Activated, "checked");
  accepted.accepted_configuration = "ab";
  const std::vector events{accepted};
  const auto refusals_for = [&](const std::string& machine_hash) {
    return obstacles_to_use({.document = document, .events = events, .machine_hash = machine_hash})
        .refusals;
  };
  EXPECT_THAT(refusals_for("ab"), IsEmpty());
  EXPECT_THAT(refusals_for("cd"), ElementsAre(HasSubstr("STALE")));
}

TEST(ModelUse, LookingAtAModelIsNeverRefused) {
  const ModelDocument document = judged_document(refused_verdict());
  const auto found = obstacles_to_use({.document = document, .purpose = ModelPurpose::Look});
  EXPECT_THAT(found.refusals, IsEmpty());
  EXPECT_THAT(found.statements, ElementsAre(HasSubstr("refused by the gate")));
}

TEST(ModelUse, DriftAndAnotherMachineStandAgainstACorrectionButNotAgainstACertificate) {
  const ModelDocument document = judged_document(ModelVerdict{.accepted = true});
  const std::vector events{event_of(document, StoreAction::Activated, ""),
                           event_of(document, StoreAction::Drifted, "EXX changed")};
  ModelInUse use{.document = document, .events = events, .machine_hash = "of another"};
  const auto control = obstacles_to_use(use);
  EXPECT_THAT(control.refusals, ElementsAre(HasSubstr("EXX changed"), HasSubstr("STALE")));
  use.purpose = ModelPurpose::Certificate;
  const auto certificate = obstacles_to_use(use);
  EXPECT_THAT(certificate.refusals, IsEmpty());
  EXPECT_THAT(certificate.statements,
              ElementsAre(HasSubstr("accepted"), HasSubstr("EXX changed"), HasSubstr("STALE")));
}

TEST(ModelUse, ADoubtOfTheIdentityStandsAgainstACorrectionOnly) {
  const ModelDocument document = judged_document(ModelVerdict{.accepted = true});
  ModelInUse use{.document = document, .identity_doubt = "of another machine"};
  EXPECT_THAT(obstacles_to_use(use).refusals, ElementsAre(HasSubstr("of another machine")));
  use.purpose = ModelPurpose::Certificate;
  EXPECT_THAT(obstacles_to_use(use).refusals, IsEmpty());
  EXPECT_THAT(obstacles_to_use(use).statements,
              ElementsAre(HasSubstr("accepted"), HasSubstr("of another machine")));
}

TEST(ModelUse, ADriftBeforeAnActivationByAPersonIsNoObstacle) {
  const ModelDocument document = judged_document(ModelVerdict{.accepted = true});
  const std::vector events{event_of(document, StoreAction::Drifted, "EXX changed"),
                           event_of(document, StoreAction::Activated, "looked at it")};
  const auto found = obstacles_to_use(
      {.document = document, .events = events, .machine_hash = document.machine_hash});
  EXPECT_THAT(found.refusals, IsEmpty());
  EXPECT_THAT(found.statements, ElementsAre(HasSubstr("accepted")));
}

class StoredVerdict : public ::testing::Test {
 protected:
  StoredVerdict() { std::filesystem::remove_all(folder_); }
  ~StoredVerdict() override { std::filesystem::remove_all(folder_); }
  ModelStore open() { return ModelStore::open(folder_).value(); }
  std::string add(const ModelDocument& document, bool accepted, std::vector<std::string> reasons) {
    return open().add(document, accepted, std::move(reasons), {"tester", "", kNoon}).value();
  }

  std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) /
      (std::string("verdict_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(StoredVerdict, IsInTheFileOfTheModel) {
  const auto id = add(judged_document({}), false, {"too large"});
  const auto read = read_model(open().model_path(id));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->verdict, (ModelVerdict{.reasons = {"too large"}}));
}

TEST_F(StoredVerdict, IsThatOfTheLastTimeItWasAdded) {
  ModelDocument document = judged_document(ModelVerdict{.accepted = true, .notes = {"dry air"}});
  const auto id = add(document, true, {});
  EXPECT_EQ(open().load(id)->verdict, document.verdict);
  (void)add(document, false, {"a smaller limit"});
  EXPECT_EQ(open().load(id)->verdict->reasons, std::vector<std::string>{"a smaller limit"});
  EXPECT_FALSE(stored_model(open(), id)->entry.accepted);
}

TEST_F(StoredVerdict, OfAForcedModelNamesThePersonAndTheReason) {
  const auto id = add(judged_document({}), false, {"too large"});
  ASSERT_TRUE(open().activate(id, {"foreman", "parts are waiting", kNoon}, true));
  const auto stored = stored_model(open(), id);
  ASSERT_TRUE(stored);
  EXPECT_EQ(state_of(stored->document.verdict), VerdictState::Forced);
  EXPECT_THAT(in_one_line(stored->document.verdict),
              testing::AllOf(HasSubstr("refused by the gate: too large"), HasSubstr("foreman"),
                             HasSubstr("parts are waiting")));
  EXPECT_TRUE(stored->entry.active);
  EXPECT_FALSE(
      obstacles_to_use({.document = stored->document, .events = stored->events}).refusals.empty());
}

TEST_F(StoredVerdict, OutlivesALostStateFile) {
  const auto accepted = add(judged_document({}), true, {});
  ModelDocument other = synthetic_document(4);
  const auto refused = add(other, false, {"too large"});
  std::filesystem::remove(folder_ / "state.json");
  const auto entries = open().list().value();
  for (const StoreEntry& entry : entries) {
    EXPECT_TRUE(entry.judged);
    EXPECT_EQ(entry.accepted, entry.id == accepted);
  }
  EXPECT_EQ(stored_model(open(), refused)->entry.reasons, std::vector<std::string>{"too large"});
  const auto done = open().activate(refused, {"tester", "", kNoon});
  ASSERT_FALSE(done);
  EXPECT_THAT(done.error().text, HasSubstr("the gate refused it: too large"));
  EXPECT_TRUE(open().activate(accepted, {"tester", "", kNoon}));
}

TEST_F(StoredVerdict, OfAModelOfAnEarlierVersionIsThatOfTheStateFile) {
  const auto id = add(judged_document({}), false, {"too large"});
  test::write_text(open().model_path(id), to_json(judged_document({})));
  EXPECT_EQ(stored_model(open(), id)->document.verdict->reasons,
            std::vector<std::string>{"too large"});
  std::filesystem::remove(folder_ / "state.json");
  EXPECT_FALSE(open().list()->front().judged);
}

}  // namespace
}  // namespace abbe::daemon
