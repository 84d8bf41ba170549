#include "abbe/daemon/model_authority.hpp"

#include <gmock/gmock.h>
#include <sched.h>
#include <sys/stat.h>

#include <fstream>
#include <set>
#include <thread>

#include "synthetic_model.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using test::text_of;
using namespace std::chrono_literals;
using protocol::HostTime;
using test::synthetic_document;
using ::testing::HasSubstr;
using v1::ModelStatus;

constexpr protocol::UtcOffset kUtc{1'700'000'000s};
constexpr HostTime kNow{1000s};
constexpr auto kPatience = 500ms;

class ModelAuthorityTest : public ::testing::Test {
 protected:
  ModelAuthorityTest() {
    fs::remove_all(folder_);
    config_.machine.name = "mill";
  }
  ~ModelAuthorityTest() override { fs::remove_all(folder_); }

  ModelAuthority open() { return ModelAuthority::open(folder_, config_, kUtc, kNow).value(); }
  /// Somebody's command, in a process of its own as it were.
  ModelStore store() { return ModelStore::open(folder_).value(); }
  [[nodiscard]] ModelDocument document(unsigned seed) const {
    auto d = synthetic_document(seed);
    d.machine_hash = machine_hash(config_);
    return d;
  }
  static StoreActor actor(std::string why, HostTime when = kNow) {
    return {"anna", std::move(why), kUtc.to_utc(when)};
  }
  /// As the daemon does it on two threads.
  static Result<std::string> add(ModelAuthority&& authority, const ModelDocument& d,
                                 const calib::Verdict& verdict, const StoreActor& who, HostTime now) {
    return add(authority, d, verdict, who, now);
  }
  static Result<std::string> add(ModelAuthority& authority, const ModelDocument& d,
                                 const calib::Verdict& verdict, const StoreActor& who, HostTime now) {
    auto kept = authority.keeper().keep(d, verdict, who, now);
    if (!kept) return tl::unexpected(kept.error());
    if (kept->active) authority.take_up(std::move(*kept->active));
    return kept->id;
  }
  /// Until it is known whether there is something new; true if there was.
  static bool follow(ModelAuthority& authority) {
    using Following = ModelAuthority::Following;
    auto following = Following::Reading;
    while (following == Following::Reading) following = authority.follow_store(kNow);
    return following == Following::TakenUp;
  }
  static ModelStanding fresh_standing(const ModelAuthority& a) { return a.standing(kNow, kNow, kPatience); }

  Config config_;
  fs::path folder_ =
      fs::path(::testing::TempDir()) /
      (std::string("authority_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(ModelAuthorityTest, WithoutAModelTheStateIsNone) {
  const auto standing = fresh_standing(open());
  EXPECT_EQ(standing.status, ModelStatus::MODEL_NONE);
  EXPECT_EQ(standing.model, nullptr);
}

TEST_F(ModelAuthorityTest, AnAcceptedModelIsActiveAtOnce) {
  auto authority = open();
  const auto id = add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow);
  ASSERT_TRUE(id) << id.error().text;
  const auto standing = fresh_standing(authority);
  EXPECT_EQ(standing.status, ModelStatus::MODEL_ACTIVE);
  EXPECT_EQ(standing.reason, "accepted by the gate");
  EXPECT_EQ(standing.model->id, *id);
}

TEST_F(ModelAuthorityTest, ARefusedModelIsKeptAndChangesNothing) {
  auto authority = open();
  const auto first = add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  const auto revision = fresh_standing(authority).revision;
  const auto second =
      add(authority, document(2), {.reasons = {"worse"}}, actor("calibrate otf"), kNow).value();
  EXPECT_TRUE(store().load(second));
  EXPECT_EQ(fresh_standing(authority).model->id, first);
  EXPECT_EQ(fresh_standing(authority).revision, revision);
}

TEST_F(ModelAuthorityTest, WithoutAxesOrWithOldOnesItIsStale) {
  auto authority = open();
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow));
  EXPECT_EQ(authority.standing(kNow, std::nullopt, kPatience).status, ModelStatus::MODEL_STALE);
  EXPECT_EQ(authority.standing(kNow + 500ms, kNow, kPatience).status, ModelStatus::MODEL_ACTIVE);
  EXPECT_EQ(authority.standing(kNow + 501ms, kNow, kPatience).status, ModelStatus::MODEL_STALE);
}

TEST_F(ModelAuthorityTest, OfAnotherMachineConfigurationItIsStale) {
  auto other = document(1);
  other.machine_hash = "of another machine";
  auto authority = open();
  ASSERT_TRUE(add(authority, other, {.accepted = true}, actor("calibrate otf"), kNow));
  const auto standing = fresh_standing(authority);
  EXPECT_EQ(standing.status, ModelStatus::MODEL_STALE);
  EXPECT_THAT(standing.reason, HasSubstr("another machine configuration"));
}

TEST_F(ModelAuthorityTest, OnlyAModelOfThisMachineConfigurationMustBeBeaten) {
  auto other = document(1);
  other.machine_hash = "of another machine";
  auto authority = open();
  EXPECT_EQ(authority.to_beat(), nullptr);
  ASSERT_TRUE(add(authority, other, {.accepted = true}, actor("calibrate otf"), kNow));
  EXPECT_NE(authority.in_force(), nullptr);
  EXPECT_EQ(authority.to_beat(), nullptr);
  // The same model, found again under the configuration the daemon has.
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow));
  EXPECT_EQ(fresh_standing(authority).status, ModelStatus::MODEL_ACTIVE);
  EXPECT_NE(authority.to_beat(), nullptr);
}

TEST_F(ModelAuthorityTest, WhereTheControlCorrectsAlreadyNoModelIsActive) {
  config_.encoder.emplace().axes_compensated = true;
  auto authority = open();
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("by hand"), kNow));
  const auto standing = fresh_standing(authority);
  EXPECT_EQ(standing.status, ModelStatus::MODEL_INVALID);
  EXPECT_THAT(standing.reason, HasSubstr("axes_compensated"));
}

TEST_F(ModelAuthorityTest, AForcedModelNamesWhoForcedItAndWhyAlsoAfterARestart) {
  auto authority = open();
  const auto id = add(authority, document(1), {.reasons = {"3 mm"}}, actor("calibrate otf"), kNow).value();
  ASSERT_TRUE(store().activate(id, actor("crane test"), true));
  ASSERT_TRUE(follow(authority));
  EXPECT_EQ(fresh_standing(authority).reason, "forced by anna: crane test");
  EXPECT_EQ(fresh_standing(open()).reason, "forced by anna: crane test");
}

TEST_F(ModelAuthorityTest, ARollbackIsSaidAndWhetherTheGateEverAcceptedTheModel) {
  auto authority = open();
  const auto forced =
      add(authority, document(1), {.reasons = {"3 mm"}}, actor("calibrate otf"), kNow).value();
  ASSERT_TRUE(store().activate(forced, actor("crane test"), true));
  ASSERT_TRUE(add(authority, document(2), {.accepted = true}, actor("calibrate otf"), kNow));
  ASSERT_TRUE(add(authority, document(3), {.accepted = true}, actor("calibrate otf"), kNow));
  ASSERT_TRUE(store().rollback(actor("drifts")));
  ASSERT_TRUE(follow(authority));
  EXPECT_EQ(fresh_standing(authority).reason, "rolled back by anna: drifts");
  ASSERT_TRUE(store().rollback(actor("drifts too", kNow + 1s)));
  ASSERT_TRUE(follow(authority));
  EXPECT_EQ(fresh_standing(authority).model->id, forced);
  EXPECT_THAT(fresh_standing(authority).reason,
              HasSubstr("a model the gate did not accept, by anna: drifts too"));
}

TEST_F(ModelAuthorityTest, FollowsTheStoreOnceForEachChange) {
  auto authority = open();
  const auto a = add(authority, document(1), {.accepted = true}, actor("first"), kNow).value();
  ASSERT_TRUE(add(authority, document(2), {.accepted = true}, actor("second"), kNow));
  EXPECT_FALSE(follow(authority));
  const auto revision = fresh_standing(authority).revision;
  ASSERT_TRUE(store().activate(a, actor("by hand")));
  EXPECT_TRUE(follow(authority));
  EXPECT_EQ(fresh_standing(authority).model->id, a);
  EXPECT_GT(fresh_standing(authority).revision, revision);
  EXPECT_FALSE(follow(authority));
}

TEST_F(ModelAuthorityTest, AStoreThatIsBeingDamagedChangesNothing) {
  auto authority = open();
  const auto id = add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  fs::resize_file(folder_ / "state.json", 10);
  EXPECT_FALSE(follow(authority));
  EXPECT_EQ(fresh_standing(authority).model->id, id);
}

// As when its owner and mode are put right: nothing of it that could be watched changes by that.
TEST_F(ModelAuthorityTest, AStoreThatCannotBeReadIsSaidAndReadAgainUntilItCan) {
  auto authority = open();
  const auto first = add(authority, document(1), {.accepted = true}, actor("first"), kNow).value();
  ASSERT_TRUE(add(authority, document(2), {.accepted = true}, actor("second"), kNow));
  ASSERT_TRUE(store().rollback(actor("drifts")));
  const fs::path state = folder_ / "state.json";
  const auto time = fs::last_write_time(state);
  std::string text = text_of(state);
  text.front() = '[';
  std::ofstream{state} << text;
  fs::last_write_time(state, time);
  EXPECT_FALSE(follow(authority));
  EXPECT_THAT(authority.fault(), HasSubstr("state.json"));
  EXPECT_THAT(fresh_standing(authority).reason, HasSubstr("state.json"));
  text.front() = '{';
  std::ofstream{state} << text;
  fs::last_write_time(state, time);
  EXPECT_TRUE(follow(authority));
  EXPECT_EQ(authority.fault(), "");
  EXPECT_EQ(fresh_standing(authority).model->id, first);
  EXPECT_EQ(fresh_standing(authority).reason, "rolled back by anna: drifts");
}

TEST_F(ModelAuthorityTest, AModelFileThatWasRepairedComesIntoForce) {
  const auto id = add(open(), document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  const fs::path file = store().model_path(id);
  fs::rename(file, folder_ / "elsewhere");
  auto authority = open();
  ASSERT_EQ(fresh_standing(authority).status, ModelStatus::MODEL_INVALID);
  fs::rename(folder_ / "elsewhere", file);
  EXPECT_TRUE(follow(authority));
  EXPECT_EQ(fresh_standing(authority).status, ModelStatus::MODEL_ACTIVE);
}

/// The store with a pipe in the place of state.json: whoever reads it waits until the test writes into it.
class SlowStore {
 public:
  explicit SlowStore(fs::path state) : state_(std::move(state)), saved_(state_.string() + ".saved") {
    fs::rename(state_, saved_);
    if (::mkfifo(state_.c_str(), 0600) != 0) throw std::runtime_error{"mkfifo"};
  }
  /// Waits until it is being read, puts the file back and gives the reader `text`.
  void answer(const std::string& text) {
    std::ofstream pipe{state_};
    fs::rename(saved_, state_);
    pipe << text;
  }

 private:
  fs::path state_, saved_;
};

TEST_F(ModelAuthorityTest, WhatWasReadBeforeAnotherModelWasTakenUpIsNotTakenUp) {
  auto authority = open();
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("first"), kNow));
  ASSERT_TRUE(store().activate(store().add(document(3), true, {}, actor("third")).value(), actor("by hand")));
  const std::string before = text_of(folder_ / "state.json");
  auto kept = authority.keeper().keep(document(2), {.accepted = true}, actor("second", kNow + 1s), kNow);
  ASSERT_TRUE(kept);
  SlowStore slow{folder_ / "state.json"};
  ASSERT_EQ(authority.follow_store(kNow), ModelAuthority::Following::Reading);
  authority.take_up(std::move(*kept->active));
  slow.answer(before);
  EXPECT_FALSE(follow(authority));
  EXPECT_EQ(fresh_standing(authority).model->id, kept->id);
  EXPECT_FALSE(follow(authority));
  EXPECT_EQ(fresh_standing(authority).model->id, kept->id);
}

TEST_F(ModelAuthorityTest, WhatWasKeptBeforeARollbackIsNotTakenUpAfterIt) {
  auto authority = open();
  const auto first = add(authority, document(1), {.accepted = true}, actor("first"), kNow).value();
  const auto since = authority.revision();
  auto kept = authority.keeper().keep(document(2), {.accepted = true}, actor("second"), kNow);
  ASSERT_TRUE(kept);
  ASSERT_TRUE(store().rollback(actor("drifts", kNow + 1s)));
  ASSERT_TRUE(follow(authority));
  authority.take_up(std::move(*kept->active), since);
  EXPECT_EQ(fresh_standing(authority).model->id, first);
  EXPECT_FALSE(follow(authority));
  EXPECT_EQ(fresh_standing(authority).model->id, first);
}

std::set<std::string> threads() {
  std::set<std::string> ids;
  for (const auto& entry : fs::directory_iterator{"/proc/self/task"}) ids.insert(entry.path().filename());
  return ids;
}

// The hub is pinned and has a real-time priority; here a batch thread on one processor stands for it.
TEST_F(ModelAuthorityTest, TheStoreIsReadOnAnOrdinaryThreadHoweverTheHubRuns) {
  auto authority = open();
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("first"), kNow));
  const std::string state = text_of(folder_ / "state.json");
  SlowStore slow{folder_ / "state.json"};
  std::set<std::string> before;
  std::thread hub{[&] {
    const sched_param none{};
    ASSERT_EQ(::sched_setscheduler(0, SCHED_BATCH, &none), 0);
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(::sched_getcpu(), &one);
    ASSERT_EQ(::sched_setaffinity(0, sizeof one, &one), 0);
    before = threads();
    EXPECT_EQ(authority.follow_store(kNow), ModelAuthority::Following::Reading);
  }};
  hub.join();
  const std::ofstream pipe{folder_ / "state.json"};  // returns when the worker has opened its end
  std::set<std::string> now = threads();
  for (const auto& id : before) now.erase(id);
  ASSERT_EQ(now.size(), 1u);
  const pid_t worker = std::stoi(*now.begin());
  EXPECT_EQ(::sched_getscheduler(worker), SCHED_OTHER);
  cpu_set_t of_worker, of_process;
  ASSERT_EQ(::sched_getaffinity(worker, sizeof of_worker, &of_worker), 0);
  ASSERT_EQ(::sched_getaffinity(::getpid(), sizeof of_process, &of_process), 0);
  EXPECT_TRUE(CPU_EQUAL(&of_worker, &of_process));
  slow.answer(state);
}

TEST_F(ModelAuthorityTest, ADamagedActiveModelIsInvalidAndNotUsed) {
  const auto id = add(open(), document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  fs::resize_file(store().model_path(id), 1000);
  auto authority = open();
  const auto standing = fresh_standing(authority);
  EXPECT_EQ(standing.status, ModelStatus::MODEL_INVALID);
  EXPECT_THAT(standing.reason, HasSubstr(id));
  EXPECT_EQ(standing.model, nullptr);
  EXPECT_FALSE(follow(authority));
}

TEST_F(ModelAuthorityTest, AModelThatCannotBePublishedIsNotTakenUp) {
  auto unpublishable = document(1);
  unpublishable.estimator = std::string(33, 'e');
  const auto id = store().add(unpublishable, true, {}, actor("by hand")).value();
  ASSERT_TRUE(store().activate(id, actor("by hand")));
  const auto standing = fresh_standing(open());
  EXPECT_EQ(standing.status, ModelStatus::MODEL_INVALID);
  EXPECT_THAT(standing.reason, testing::AllOf(HasSubstr("cannot be published"), HasSubstr("estimator")));
}

TEST_F(ModelAuthorityTest, ARestartDoesNotMakeTheModelYounger) {
  ASSERT_TRUE(add(open(), document(1), {.accepted = true}, actor("calibrate otf", kNow - 24h), kNow));
  EXPECT_EQ(fresh_standing(open()).model->active_since, kNow - 24h);
}

TEST_F(ModelAuthorityTest, AWallClockThatWasSetBackDoesNotMakeAnAgeNegative) {
  ASSERT_TRUE(add(open(), document(1), {.accepted = true}, actor("calibrate otf", kNow + 1h), kNow));
  EXPECT_EQ(fresh_standing(open()).model->active_since, kNow);
}

}  // namespace
}  // namespace abbe::daemon
