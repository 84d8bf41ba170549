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
