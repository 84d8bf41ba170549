#include "abbe/service/store_changes.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <stdlib.h>
#include <sys/file.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/file_descriptor.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using test::synthetic_document;
using ::testing::HasSubstr;

struct StoreChangesTest : ::testing::Test {
  StoreChangesTest() {
    std::string name = ::testing::TempDir() + "abbe-changes-XXXXXX";
    folder_ = ::mkdtemp(name.data());
    changes_.emplace(folder_ / "models");
    auto store = ModelStore::open(folder_ / "models");
    const StoreActor actor{.who = "test", .why = "", .when = {}};
    for (const unsigned seed : {1u, 2u}) {
      ids_.push_back(store->add(synthetic_document(seed), true, {}, actor).value());
      EXPECT_TRUE(store->activate(ids_.back(), actor));
    }
  }

  ~StoreChangesTest() override {
    changes_.reset();
    std::filesystem::remove_all(folder_);
  }

  std::filesystem::path folder_;
  std::vector<std::string> ids_;
  std::optional<StoreChanges> changes_;
};

TEST_F(StoreChangesTest, RollsBackWithUserAndReason) {
  const auto number = changes_->roll_back({.active = ids_[1], .who = "anna", .why = "a crash"});
  ASSERT_TRUE(number);
  const auto outcome = changes_->outcome(*number, 60s);
  ASSERT_TRUE(outcome);
  ASSERT_TRUE(*outcome) << outcome->error().text;
  EXPECT_EQ(**outcome, ids_[0]);
  EXPECT_EQ(**changes_->outcome(*number, 0s), ids_[0]);  // asked again
  const auto events = ModelStore{folder_ / "models"}.history();
  ASSERT_TRUE(events);
  EXPECT_EQ(events->back().actor.who, "anna");
  EXPECT_EQ(events->back().actor.why, "a crash");
}

TEST_F(StoreChangesTest, ARepeatedRollBackIsRefusedAndChangesNothing) {
  const RollBack asked{.active = ids_[1], .who = "anna", .why = "a crash"};
  EXPECT_EQ(**changes_->outcome(*changes_->roll_back(asked), 60s), ids_[0]);
  const auto again = changes_->outcome(*changes_->roll_back(asked), 60s);
  ASSERT_TRUE(again);
  ASSERT_FALSE(*again);
  EXPECT_EQ(again->error().code, ErrorCode::Refused);
  EXPECT_THAT(again->error().text, HasSubstr(ids_[1] + " is not active (model " + ids_[0]));
  EXPECT_EQ(ModelStore{folder_ / "models"}.active_id().value(), ids_[0]);
}

TEST_F(StoreChangesTest, AnUnknownModelIsNamed) {
  const auto number = changes_->activate({.id = "0123456789abcdef", .who = "anna", .why = ""});
  ASSERT_TRUE(number);
  const auto outcome = changes_->outcome(*number, 60s);
  ASSERT_TRUE(outcome);
  ASSERT_FALSE(*outcome);
  EXPECT_THAT(outcome->error().text, HasSubstr("0123456789abcdef"));
}

TEST_F(StoreChangesTest, AForcedActivationNeedsAReason) {
  const auto number = changes_->activate({.id = ids_[0], .who = "anna", .why = "", .force = true});
  ASSERT_FALSE(number);
  EXPECT_EQ(number.error().code, ErrorCode::Usage);
}

struct StoreAdditionTest : StoreChangesTest {
  /// As another process identified it.
  static ModelDocument judged(bool accepted) {
    ModelDocument document = synthetic_document(3);
    document.verdict = ModelVerdict{.accepted = accepted};
    if (!accepted) document.verdict->reasons = {"worse than the active model"};
    return document;
  }
  [[nodiscard]] Result<std::string> add(const ModelDocument& document, std::string hash) {
    const auto number = changes_->add({.model = to_json(document),
                                       .present = {.hash = std::move(hash)},
                                       .who = "anna",
                                       .why = "identified again"});
    if (!number) return tl::unexpected(number.error());
    return changes_->outcome(*number, 60s).value();
  }
};

TEST_F(StoreAdditionTest, AModelIsAddedWithItsVerdictAndNotActivated) {
  for (const bool accepted : {true, false}) {
    const ModelDocument document = judged(accepted);
    const auto id = add(document, document.machine_hash);
    ASSERT_TRUE(id) << id.error().text;
    EXPECT_EQ(*id, model_id(document));
    const auto entries = ModelStore{folder_ / "models"}.list();
    ASSERT_TRUE(entries);
    EXPECT_EQ(entries->front().id, *id);
    EXPECT_EQ(entries->front().accepted, accepted);
    EXPECT_EQ(ModelStore{folder_ / "models"}.history()->back().actor.why, "identified again");
    EXPECT_EQ(ModelStore{folder_ / "models"}.active_id().value(), ids_[1]);
  }
}

TEST_F(StoreAdditionTest, AModelWithoutVerdictOrOfAnotherMachineIsNotAdded) {
  ModelDocument unjudged = synthetic_document(3);
  unjudged.verdict.reset();
  const auto without = add(unjudged, unjudged.machine_hash);
  ASSERT_FALSE(without);
  EXPECT_EQ(without.error().code, ErrorCode::BadInput);
  const auto other = add(judged(true), "another machine");
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::Refused);
  EXPECT_EQ(ModelStore{folder_ / "models"}.list()->size(), 2u);
}

TEST_F(StoreChangesTest, ATextThatIsNoModelIsNotAdded) {
  const auto number = changes_->add({.model = "{}", .present = {}, .who = "anna", .why = ""});
  ASSERT_TRUE(number);
  const auto outcome = changes_->outcome(*number, 60s);
  ASSERT_TRUE(outcome);
  ASSERT_FALSE(*outcome);
  EXPECT_EQ(outcome->error().code, ErrorCode::BadInput);
}

TEST_F(StoreChangesTest, WhileAnotherProcessHasTheLockAChangeRunsAndASecondIsRefused) {
  const FileDescriptor held{::open((folder_ / "models/lock").c_str(), O_RDWR | O_CLOEXEC)};
  ASSERT_TRUE(held);
  ASSERT_EQ(::flock(held.get(), LOCK_EX), 0);
  const RollBack asked{.active = ids_[1], .who = "anna", .why = ""};
  const auto number = changes_->roll_back(asked);
  ASSERT_TRUE(number);
  EXPECT_FALSE(changes_->outcome(*number, 0ms));
  EXPECT_THAT(changes_->roll_back(asked).error().text, HasSubstr("is not done yet"));
  ASSERT_EQ(::flock(held.get(), LOCK_UN), 0);
  const auto outcome = changes_->outcome(*number, 60s);
  ASSERT_TRUE(outcome);
  EXPECT_TRUE(*outcome);
}

TEST_F(StoreChangesTest, OnlyTheLastChangeIsKnown) {
  const auto outcome = changes_->outcome(1, 0ms);
  ASSERT_TRUE(outcome);
  EXPECT_EQ(outcome->error().code, ErrorCode::Usage);
}

}  // namespace
}  // namespace abbe::daemon
