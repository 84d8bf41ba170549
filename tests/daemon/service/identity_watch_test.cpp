#include "abbe/service/identity_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <thread>

#include "abbe/service/background_tasks.hpp"
#include "abbe_command.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using v1::ModelStatus;

constexpr protocol::UtcTime kStart{20'000h * 24};
const ComputerMarks kThisComputer{.machine_id = "a", .interfaces = {"1"}};
const ComputerMarks kElsewhere{.machine_id = "b", .interfaces = {"2"}};

class IdentityWatchTest : public testing::Test {
 protected:
  IdentityWatchTest() {
    std::string name = testing::TempDir() + "abbe-identity-watch-XXXXXX";
    folder_ = ::mkdtemp(name.data());
    prepare_background_tasks();
  }
  ~IdentityWatchTest() override { std::filesystem::remove_all(folder_); }

  IdentityWatch open(const ComputerMarks& here) {
    return IdentityWatch::open(folder_, here, kStart);
  }
  static ActiveModelState restricted(const IdentityWatch& watch,
                                     ModelStatus status = ModelStatus::MODEL_ACTIVE) {
    ActiveModelState state{.status = status, .reason = "accepted"};
    watch.restrict(state);
    return state;
  }
  /// Follows until `done`; the file is read on another thread.
  template <class Done>
  static bool follows(IdentityWatch& watch, Done done) {
    IdentityWatch::WallTime now{};
    for (int i = 0; i < 20'000 && !done(); ++i) {
      watch.follow(now += 2s);
      std::this_thread::sleep_for(1ms);
    }
    return done();
  }

  std::filesystem::path folder_;
};

TEST_F(IdentityWatchTest, OnTheComputerWhereItWasMadeAModelStaysActive) {
  const auto made = open(kThisComputer);
  const auto again = open(kThisComputer);
  EXPECT_EQ(again.known().machine_id, made.known().machine_id);
  EXPECT_EQ(restricted(again).status, ModelStatus::MODEL_ACTIVE);
  EXPECT_TRUE(again.health("").status.connected);
}

TEST_F(IdentityWatchTest, OnAnotherComputerNoModelIsActiveBeforeAPersonConfirmsIt) {
  const auto machine_id = open(kThisComputer).known().machine_id;
  auto copied = open(kElsewhere);
  EXPECT_EQ(copied.known().machine_id, machine_id);
  for (const auto status : {ModelStatus::MODEL_ACTIVE, ModelStatus::MODEL_DRIFT})
    EXPECT_EQ(restricted(copied, status).status, ModelStatus::MODEL_STALE);
  EXPECT_THAT(restricted(copied).reason, HasSubstr("abbe machine identity keep"));
  EXPECT_THAT(copied.health("").status.last_fault, HasSubstr("another computer"));
  EXPECT_FALSE(copied.health("").status.connected);

  ASSERT_TRUE(decide_identity(folder_, kElsewhere, {.action = IdentityAction::Kept}));
  EXPECT_TRUE(follows(copied, [&] { return copied.known().doubt.empty(); }));
  EXPECT_EQ(copied.known().machine_id, machine_id);
  EXPECT_EQ(restricted(copied).status, ModelStatus::MODEL_ACTIVE);
}

/// The clock is wrong when the person decides, and a roll-back does not make a model one of this
/// machine.
TEST_F(IdentityWatchTest, AfterNewOnlyAModelThatWasActivatedLaterMayBeUsed) {
  auto store = ModelStore::open(folder_ / "models").value();
  const auto activate = [&store](unsigned seed) {
    const StoreActor actor{"tester", "", kStart};
    const auto id = store.add(test::synthetic_document(seed), true, {}, actor).value();
    EXPECT_TRUE(store.activate(id, actor));
    return id;
  };
  const auto machine_id = open(kThisComputer).known().machine_id;
  const auto copied_model = activate(1);
  auto copied = open(kElsewhere);
  ASSERT_TRUE(decide_identity(folder_, kElsewhere,
                              {.action = IdentityAction::Renewed, .when = kStart + 1h}));
  const auto own_model = activate(2);
  ASSERT_TRUE(store.rollback({"tester", "", kStart + 2h}, own_model));

  ASSERT_TRUE(follows(copied, [&] { return copied.known().machine_id != machine_id; }));
  EXPECT_THAT(copied.objection_to(copied_model), HasSubstr("abbe model activate"));
  EXPECT_EQ(copied.objection_to(own_model), "");
  EXPECT_THAT(identity_doubt(store, copied_model, kElsewhere), HasSubstr("data folder was copied"));
  EXPECT_EQ(identity_doubt(store, own_model, kElsewhere), "");

  (void)activate(1);
  EXPECT_TRUE(follows(copied, [&] { return copied.objection_to(copied_model).empty(); }));
}

TEST_F(IdentityWatchTest, ATwinIsReportedAndDoesNotStopTheModel) {
  const auto watch = open(kThisComputer);
  const auto health = watch.health("the same name, machine_id 4711, from DDS participant 01");
  EXPECT_STREQ(std::string(health.status.state).c_str(), "twin");
  EXPECT_THAT(health.status.last_fault, HasSubstr("machine_id 4711"));
  EXPECT_EQ(restricted(watch).status, ModelStatus::MODEL_ACTIVE);
}

TEST_F(IdentityWatchTest, ADamagedFileLetsNoModelBecomeActive) {
  ASSERT_FALSE(open(kThisComputer).known().machine_id.empty());
  std::filesystem::resize_file(identity_file(folder_), 10);
  const auto damaged = open(kThisComputer);
  EXPECT_EQ(restricted(damaged).status, ModelStatus::MODEL_STALE);
  EXPECT_THAT(damaged.health("").status.last_fault, HasSubstr("identity.json"));
}

TEST_F(IdentityWatchTest, WhileTheFileCannotBeReadTheDoubtStays) {
  const auto machine_id = open(kThisComputer).known().machine_id;
  auto copied = open(kElsewhere);
  const auto doubt = copied.known().doubt;
  const auto file = identity_file(folder_);
  std::filesystem::remove(file);
  std::filesystem::create_symlink(file, file);
  ASSERT_TRUE(follows(copied, [&] { return !copied.known().fault.empty(); }));
  EXPECT_EQ(copied.known().doubt, doubt);
  EXPECT_EQ(copied.known().machine_id, machine_id);
  EXPECT_EQ(restricted(copied).status, ModelStatus::MODEL_STALE);
}

TEST_F(IdentityWatchTest, TheCommandShowsTheIdentityAndRecordsADecision) {
  const std::string machine_id = open(kElsewhere).known().machine_id;
  const auto identity = [this](const std::string& more) {
    return test::run_abbe(folder_, "machine identity --data-dir . " + more);
  };
  EXPECT_EQ(identity("").exit, 0);
  EXPECT_THAT(identity("").out, HasSubstr(machine_id));

  EXPECT_EQ(identity("keep").exit, 2);  // without a reason
  const auto kept = identity("keep --reason 'computer replaced'");
  EXPECT_EQ(kept.exit, 0) << kept.err;
  EXPECT_THAT(identity("").out, HasSubstr("computer replaced"));
  const auto renewed = identity("new --reason 'second machine'");
  EXPECT_EQ(renewed.exit, 0) << renewed.err;
  EXPECT_NE(read_identity(folder_).value()->machine_id, machine_id);
  EXPECT_NE(test::run_abbe(folder_, "machine identity --data-dir none").exit, 0);
}

}  // namespace
}  // namespace abbe::daemon
