#include "abbe/service/model_authority.hpp"

#include <gmock/gmock.h>
#include <sched.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <future>
#include <memory>
#include <thread>

#include "abbe/messages/cdr.hpp"
#include "abbe/service/background_tasks.hpp"
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

  /// The wall clock at kNow.
  static WallClock clock() {
    return WallClock{[] { return ClockReading{.utc = kUtc.to_utc(kNow).time_since_epoch()}; }};
  }
  ModelAuthority open() { return ModelAuthority::open(folder_, config_, clock(), kNow); }
  /// The store as a command in another process opens it.
  ModelStore store() { return ModelStore::open(folder_).value(); }
  std::string active_id() { return store().active_id().value().value(); }
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
                                 const calib::Verdict& verdict, const StoreActor& who,
                                 HostTime now) {
    return add(authority, d, verdict, who, now);
  }
  static Result<std::string> add(ModelAuthority& authority, const ModelDocument& d,
                                 const calib::Verdict& verdict, const StoreActor& who,
                                 HostTime now) {
    auto kept = authority.keeper().keep(d, verdict, who, now);
    if (!kept) return tl::unexpected(kept.error());
    if (kept->active) authority.set_active(std::move(*kept->active));
    return kept->id;
  }
  /// Until it is known whether there is something new; true if there was.
  static bool follow(ModelAuthority& authority) {
    using Following = ModelAuthority::Following;
    auto following = Following::Reading;
    while (following == Following::Reading) following = authority.follow_store(kNow);
    return following == Following::Replaced;
  }
  static ActiveModelState fresh_state(const ModelAuthority& a) {
    return a.model_state(kNow, kNow, kPatience);
  }

  Config config_;
  fs::path folder_ =
      fs::path(::testing::TempDir()) /
      (std::string("authority_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

/// As the service does every five seconds, where the last step failed.
TEST_F(ModelAuthorityTest, AModelThatIsKeptAgainIsEnteredOnce) {
  auto authority = open();
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("t"), kNow));
  const auto history = store().history().value();
  ASSERT_EQ(history.size(), 2u);
  EXPECT_EQ(history[0].action, StoreAction::Added);
  EXPECT_EQ(history[1].action, StoreAction::Activated);
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("t", kNow + 1s), kNow));
  EXPECT_EQ(store().history()->size(), 4u) << "another calibration";
}

TEST_F(ModelAuthorityTest, WithoutAModelTheStateIsNone) {
  const auto state = fresh_state(open());
  EXPECT_EQ(state.status, ModelStatus::MODEL_NONE);
  EXPECT_EQ(state.model, nullptr);
}

TEST_F(ModelAuthorityTest, AnAcceptedModelIsActiveAtOnce) {
  auto authority = open();
  const auto id = add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow);
  ASSERT_TRUE(id) << id.error().text;
  const auto state = fresh_state(authority);
  EXPECT_EQ(state.status, ModelStatus::MODEL_ACTIVE);
  EXPECT_EQ(state.reason, "accepted by the gate");
  EXPECT_EQ(state.model->id, *id);
}

TEST_F(ModelAuthorityTest, ARefusedModelIsKeptAndChangesNothing) {
  auto authority = open();
  const auto first =
      add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  const auto revision = fresh_state(authority).revision;
  const auto second =
      add(authority, document(2), {.reasons = {"worse"}}, actor("calibrate otf"), kNow).value();
  EXPECT_TRUE(store().load(second));
  EXPECT_EQ(fresh_state(authority).model->id, first);
  EXPECT_EQ(fresh_state(authority).revision, revision);
}

TEST_F(ModelAuthorityTest, WithoutAxesOrWithOldOnesItIsStale) {
  auto authority = open();
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow));
  EXPECT_EQ(authority.model_state(kNow, std::nullopt, kPatience).status, ModelStatus::MODEL_STALE);
  EXPECT_EQ(authority.model_state(kNow + 500ms, kNow, kPatience).status, ModelStatus::MODEL_ACTIVE);
  EXPECT_EQ(authority.model_state(kNow + 501ms, kNow, kPatience).status, ModelStatus::MODEL_STALE);
}

TEST_F(ModelAuthorityTest, OfAnotherMachineConfigurationItIsStale) {
  auto other = document(1);
  other.machine_hash = "of another machine";
  auto authority = open();
  ASSERT_TRUE(add(authority, other, {.accepted = true}, actor("calibrate otf"), kNow));
  const auto state = fresh_state(authority);
  EXPECT_EQ(state.status, ModelStatus::MODEL_STALE);
  EXPECT_THAT(state.reason, HasSubstr("another machine configuration"));
}

TEST_F(ModelAuthorityTest, IsComparedOnlyWithAModelOfThisMachineConfiguration) {
  auto other = document(1);
  other.machine_hash = "of another machine";
  auto authority = open();
  EXPECT_EQ(authority.comparison_model(), nullptr);
  ASSERT_TRUE(add(authority, other, {.accepted = true}, actor("calibrate otf"), kNow));
  EXPECT_NE(authority.active_model(), nullptr);
  EXPECT_EQ(authority.comparison_model(), nullptr);
  // The same model, found again under the configuration the daemon has.
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow));
  EXPECT_EQ(fresh_state(authority).status, ModelStatus::MODEL_ACTIVE);
  EXPECT_NE(authority.comparison_model(), nullptr);
}

TEST_F(ModelAuthorityTest, WhereTheControlCorrectsAlreadyNoModelIsActive) {
  config_.of<EncoderConfig>().emplace().axes_compensated = true;
  auto authority = open();
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("by hand"), kNow));
  const auto state = fresh_state(authority);
  EXPECT_EQ(state.status, ModelStatus::MODEL_INVALID);
  EXPECT_THAT(state.reason, HasSubstr("axes_compensated"));
}

TEST_F(ModelAuthorityTest, AForcedModelNamesUserAndReasonAlsoAfterARestart) {
  auto authority = open();
  const auto id =
      add(authority, document(1), {.reasons = {"3 mm"}}, actor("calibrate otf"), kNow).value();
  ASSERT_TRUE(store().activate(id, actor("crane test"), true));
  ASSERT_TRUE(follow(authority));
  const std::string reason = "forced by anna: crane test; the gate had refused it: 3 mm";
  EXPECT_EQ(fresh_state(authority).reason, reason);
  EXPECT_EQ(fresh_state(open()).reason, reason);
  EXPECT_EQ(fresh_state(open()).refused, "3 mm");
}

TEST_F(ModelAuthorityTest, ARollbackIsReportedWithTheVerdictOfTheGate) {
  auto authority = open();
  const auto forced =
      add(authority, document(1), {.reasons = {"3 mm"}}, actor("calibrate otf"), kNow).value();

  ASSERT_TRUE(store().activate(forced, actor("crane test"), true));
  ASSERT_TRUE(add(authority, document(2), {.accepted = true}, actor("calibrate otf"), kNow));
  ASSERT_TRUE(add(authority, document(3), {.accepted = true}, actor("calibrate otf"), kNow));
  ASSERT_TRUE(store().rollback(actor("drifts"), active_id()));
  ASSERT_TRUE(follow(authority));
  EXPECT_EQ(fresh_state(authority).reason, "rolled back by anna: drifts");
  ASSERT_TRUE(store().rollback(actor("drifts too", kNow + 1s), active_id()));
  ASSERT_TRUE(follow(authority));
  EXPECT_EQ(fresh_state(authority).model->id, forced);
  EXPECT_THAT(fresh_state(authority).reason,
              HasSubstr("a model the gate did not accept, by anna: drifts too"));
}

TEST_F(ModelAuthorityTest, FollowsTheStoreOnceForEachChange) {
  auto authority = open();
  const auto a = add(authority, document(1), {.accepted = true}, actor("first"), kNow).value();
  ASSERT_TRUE(add(authority, document(2), {.accepted = true}, actor("second"), kNow));
  EXPECT_FALSE(follow(authority));
  const auto revision = fresh_state(authority).revision;
  ASSERT_TRUE(store().activate(a, actor("by hand")));
  EXPECT_TRUE(follow(authority));
  EXPECT_EQ(fresh_state(authority).model->id, a);
  EXPECT_GT(fresh_state(authority).revision, revision);
  EXPECT_FALSE(follow(authority));
}

TEST_F(ModelAuthorityTest, AStoreThatBecomesDamagedChangesNothing) {
  auto authority = open();
  const auto id =
      add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  fs::resize_file(folder_ / "state.json", 10);
  EXPECT_FALSE(follow(authority));
  EXPECT_EQ(fresh_state(authority).model->id, id);
}

// As when its owner and mode are put right: nothing of it that could be watched changes by that.
TEST_F(ModelAuthorityTest, AnUnreadableStoreIsReportedAndReadAgain) {
  auto authority = open();
  const auto first = add(authority, document(1), {.accepted = true}, actor("first"), kNow).value();

  ASSERT_TRUE(add(authority, document(2), {.accepted = true}, actor("second"), kNow));
  ASSERT_TRUE(store().rollback(actor("drifts"), active_id()));
  const fs::path state = folder_ / "state.json";
  const auto time = fs::last_write_time(state);
  std::string text = text_of(state);
  text.front() = '[';
  std::ofstream{state} << text;
  fs::last_write_time(state, time);
  EXPECT_FALSE(follow(authority));
  EXPECT_THAT(authority.fault(), HasSubstr("state.json"));
  EXPECT_THAT(fresh_state(authority).reason, HasSubstr("state.json"));
  text.front() = '{';
  std::ofstream{state} << text;
  fs::last_write_time(state, time);
  EXPECT_TRUE(follow(authority));
  EXPECT_EQ(authority.fault(), "");
  EXPECT_EQ(fresh_state(authority).model->id, first);
  EXPECT_EQ(fresh_state(authority).reason, "rolled back by anna: drifts");
}

TEST_F(ModelAuthorityTest, ARepairedModelFileBecomesActive) {
  const auto id =
      add(open(), document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  const fs::path file = store().model_path(id);
  fs::rename(file, folder_ / "elsewhere");
  auto authority = open();
  ASSERT_EQ(fresh_state(authority).status, ModelStatus::MODEL_INVALID);
  fs::rename(folder_ / "elsewhere", file);
  EXPECT_TRUE(follow(authority));
  EXPECT_EQ(fresh_state(authority).status, ModelStatus::MODEL_ACTIVE);
}

TEST_F(ModelAuthorityTest, AReadResultOlderThanTheActiveModelIsDiscarded) {
  auto authority = open();
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("first"), kNow));
  ASSERT_TRUE(store().activate(store().add(document(3), true, {}, actor("third")).value(),
                               actor("by hand")));
  const std::string before = text_of(folder_ / "state.json");
  auto kept =
      authority.keeper().keep(document(2), {.accepted = true}, actor("second", kNow + 1s), kNow);

  ASSERT_TRUE(kept);
  const std::string after = text_of(folder_ / "state.json");
  std::ofstream{folder_ / "state.json"} << before;
  (void)authority.follow_store(kNow);  // reads what was before, and is asked for it only below
  authority.set_active(std::move(*kept->active));
  EXPECT_FALSE(follow(authority));
  std::ofstream{folder_ / "state.json"} << after;
  EXPECT_EQ(fresh_state(authority).model->id, kept->id);
  EXPECT_FALSE(follow(authority));
  EXPECT_EQ(fresh_state(authority).model->id, kept->id);
}

TEST_F(ModelAuthorityTest, AModelStoredBeforeARollbackIsNotActivatedAfterIt) {
  auto authority = open();
  const auto first = add(authority, document(1), {.accepted = true}, actor("first"), kNow).value();
  const auto since = authority.revision();
  auto kept = authority.keeper().keep(document(2), {.accepted = true}, actor("second"), kNow);
  ASSERT_TRUE(kept);
  ASSERT_TRUE(store().rollback(actor("drifts", kNow + 1s), active_id()));
  ASSERT_TRUE(follow(authority));
  authority.set_active(std::move(*kept->active), since);
  EXPECT_EQ(fresh_state(authority).model->id, first);
  EXPECT_FALSE(follow(authority));
  EXPECT_EQ(fresh_state(authority).model->id, first);
}

TEST_F(ModelAuthorityTest, AModelIsEncodedInTheThreadThatReadsIt) {
  auto authority = open();
  ASSERT_TRUE(add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow));
  const auto state = fresh_state(authority);
  ASSERT_NE(state.publication, nullptr);
  const auto model = decode<v1::ErrorModel>(state.publication->model);
  ASSERT_TRUE(model);
  EXPECT_EQ(*model, model_message(*state.model, {.machine = "mill"}));
  EXPECT_EQ(state.publication->slices.size(),
            grid_messages(*state.model, {.machine = "mill"}).size());
}

TEST_F(ModelAuthorityTest, TheKeptModelEqualsTheModelOfTheStoreBitForBit) {
  auto authority = open();
  const auto written = document(1);
  const auto kept =
      authority.keeper().keep(written, {.accepted = true}, actor("calibrate otf"), kNow).value();
  const auto read = authority.keeper().read_active(kNow).value();
  EXPECT_EQ(to_json(store().load(kept.id).value()), to_json(written));
  EXPECT_EQ(kept.active->publication.model, read.publication.model);
  EXPECT_EQ(kept.active->publication.slices, read.publication.slices);
  EXPECT_EQ(kept.active->activation, read.activation);
}

/// The file of a model is never changed: a second calibration may give the same model.
TEST_F(ModelAuthorityTest, AModelThatTheStoreHoldsWithAnotherDateIsReturnedAsStored) {
  auto authority = open();
  auto earlier = document(1), later = document(1);
  later.created = earlier.created + 1h;
  ASSERT_TRUE(authority.keeper().keep(earlier, {.accepted = true}, actor("first"), kNow));
  const auto kept = authority.keeper().keep(later, {.accepted = true}, actor("second"), kNow);
  ASSERT_TRUE(kept);
  EXPECT_EQ(kept->active->model->created, earlier.created);
  EXPECT_EQ(kept->active->activation.actor.why, "second");
}

TEST_F(ModelAuthorityTest, ThePreviousModelIsDestroyedOnAnotherThread) {
  auto authority = open();
  const auto destroyed = std::make_shared<std::promise<std::thread::id>>();
  ActiveModel first;
  first.model = std::shared_ptr<const PublishedModel>{
      new PublishedModel{.id = "first", .model = document(1).model},
      [destroyed](const PublishedModel* m) {
        delete m;
        destroyed->set_value(std::this_thread::get_id());
      }};
  authority.set_active(std::move(first));

  ASSERT_EQ(authority.active_model()->id, "first");
  authority.set_active(ActiveModel{});
  EXPECT_NE(destroyed->get_future().get(), std::this_thread::get_id());
}

// The hub is pinned and has a real-time priority; here a batch thread on one processor stands for
// it.
TEST(BackgroundTasks, RunsOnAnOrdinaryThreadHoweverTheHubRuns) {
  struct Seen {
    int policy = -1;
    cpu_set_t cpus{};
  };

  Seen seen;
  std::thread hub{[&] {
    const sched_param none{};
    ASSERT_EQ(::sched_setscheduler(0, SCHED_BATCH, &none), 0);
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(::sched_getcpu(), &one);
    ASSERT_EQ(::sched_setaffinity(0, sizeof one, &one), 0);
    seen = run_in_background([] {
             Seen of_worker{.policy = ::sched_getscheduler(0)};
             (void)::sched_getaffinity(0, sizeof of_worker.cpus, &of_worker.cpus);
             return of_worker;
           }).get();
  }};
  hub.join();
  EXPECT_EQ(seen.policy, SCHED_OTHER);
  cpu_set_t of_process;
  ASSERT_EQ(::sched_getaffinity(::getpid(), sizeof of_process, &of_process), 0);
  EXPECT_TRUE(CPU_EQUAL(&seen.cpus, &of_process));
}

TEST_F(ModelAuthorityTest, ADamagedActiveModelIsInvalidAndNotUsed) {
  const auto id =
      add(open(), document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  fs::resize_file(store().model_path(id), 1000);
  auto authority = open();
  const auto state = fresh_state(authority);
  EXPECT_EQ(state.status, ModelStatus::MODEL_INVALID);
  EXPECT_THAT(state.reason, HasSubstr(id));
  EXPECT_EQ(state.model, nullptr);
  EXPECT_FALSE(follow(authority));
}

TEST_F(ModelAuthorityTest, ADamagedStateIsRenamedAtTheStartAndReportedUntilAModelIsActivated) {
  const auto id =
      add(open(), document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  fs::resize_file(folder_ / "state.json", 30);
  auto authority = open();
  const std::string aside = "state.json.damaged-2023-11-14T22-30-00Z";

  EXPECT_TRUE(fs::exists(folder_ / aside));
  EXPECT_EQ(fresh_state(authority).status, ModelStatus::MODEL_INVALID);
  EXPECT_THAT(fresh_state(authority).reason, HasSubstr(aside));
  EXPECT_THAT(authority.fault(), HasSubstr(aside));
  EXPECT_THAT(open().fault(), HasSubstr(aside)) << "also after another restart";
  ASSERT_TRUE(store().activate(id, actor("it was this one"), true));
  EXPECT_TRUE(follow(authority));
  EXPECT_EQ(authority.fault(), "");
  EXPECT_EQ(fresh_state(authority).status, ModelStatus::MODEL_ACTIVE);
}

// As where the disk is read-only at the start, or the store's lock is held: the name is taken.
TEST_F(ModelAuthorityTest, ADamagedStateThatCannotBeRenamedAtTheStartIsRenamedLater) {
  (void)add(open(), document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  fs::resize_file(folder_ / "state.json", 30);
  const auto aside = folder_ / "state.json.damaged-2023-11-14T22-30-00Z";
  std::ofstream{aside} << "of before";
  auto authority = open();
  for (int look = 0; look < 3; ++look) EXPECT_FALSE(follow(authority));

  EXPECT_THAT(authority.fault(), HasSubstr("rename"));
  EXPECT_FALSE(
      authority.keeper().keep(document(2), {.accepted = true}, actor("calibrate otf"), kNow));
  fs::remove(aside);
  EXPECT_TRUE(follow(authority));
  EXPECT_EQ(fs::file_size(aside), 30u);
  EXPECT_THAT(authority.fault(), HasSubstr(aside.filename().string()));
  EXPECT_TRUE(add(authority, document(2), {.accepted = true}, actor("calibrate otf"), kNow));
  follow(authority);
  EXPECT_EQ(authority.fault(), "");
}

TEST_F(ModelAuthorityTest, AStateThatIsDamagedLaterIsRenamedAndTheModelStaysActive) {
  auto authority = open();
  const auto id =
      add(authority, document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  fs::resize_file(folder_ / "state.json", 30);

  EXPECT_FALSE(follow(authority));
  EXPECT_TRUE(fs::exists(folder_ / "state.json")) << "somebody may be writing it";
  for (int look = 0; look < 3; ++look) EXPECT_FALSE(follow(authority));
  EXPECT_FALSE(fs::exists(folder_ / "state.json"));
  EXPECT_EQ(fresh_state(authority).model->id, id);
  EXPECT_EQ(fresh_state(authority).status, ModelStatus::MODEL_ACTIVE);
  EXPECT_THAT(authority.fault(), HasSubstr("kept as state.json.damaged-"));
  const auto second = add(authority, document(2), {.accepted = true}, actor("calibrate otf"), kNow);
  ASSERT_TRUE(second) << second.error().text;
  follow(authority);
  EXPECT_EQ(authority.fault(), "");
  EXPECT_EQ(fresh_state(authority).model->id, *second);
}

// A read-only disk, a missing permission: root is refused nothing, so a file stands for them.
TEST_F(ModelAuthorityTest, AStoreThatCannotBeMadeIsReportedAndTriedAgain) {
  std::ofstream{folder_} << "in the way";
  auto authority = open();
  EXPECT_THAT(authority.fault(), HasSubstr(folder_.string()));
  EXPECT_EQ(fresh_state(authority).status, ModelStatus::MODEL_INVALID);
  fs::remove(folder_);
  EXPECT_TRUE(follow(authority));
  EXPECT_EQ(authority.fault(), "");
  EXPECT_EQ(fresh_state(authority).status, ModelStatus::MODEL_NONE);
}

TEST_F(ModelAuthorityTest, TheStartRemovesWhatKilledProcessesLeftInTheStore) {
  const auto id =
      add(open(), document(1), {.accepted = true}, actor("calibrate otf"), kNow).value();
  const auto left = {folder_ / "state.json.999999999.new",
                     folder_ / "models" / (id + ".json.999999999.new")};
  const auto living = folder_ / ("state.json." + std::to_string(::getppid()) + ".new");
  for (const auto& file : left) std::ofstream{file} << "half";
  std::ofstream{living} << "half";
  (void)open();
  for (const auto& file : left) EXPECT_FALSE(fs::exists(file)) << file;
  EXPECT_TRUE(fs::exists(living)) << "it may be writing";
}

TEST_F(ModelAuthorityTest, AModelThatNoReplayCanCheckIsMarked) {
  auto unchecked = document(1);
  unchecked.recording_gap = "12 messages of the run are missing";
  auto authority = open();
  ASSERT_TRUE(add(authority, unchecked, {.accepted = true}, actor("calibrate otf"), kNow));
  EXPECT_EQ(fresh_state(authority).status, ModelStatus::MODEL_ACTIVE);
  EXPECT_EQ(
      fresh_state(authority).reason,
      "accepted by the gate; no replay can check this model: 12 messages of the run are missing");
}

TEST_F(ModelAuthorityTest, AModelThatCannotBePublishedIsNotActivated) {
  auto unpublishable = document(1);
  unpublishable.estimator = std::string(33, 'e');
  const auto id = store().add(unpublishable, true, {}, actor("by hand")).value();
  ASSERT_TRUE(store().activate(id, actor("by hand")));
  const auto state = fresh_state(open());
  EXPECT_EQ(state.status, ModelStatus::MODEL_INVALID);
  EXPECT_THAT(state.reason,
              testing::AllOf(HasSubstr("cannot be published"), HasSubstr("estimator")));
}

TEST_F(ModelAuthorityTest, ARestartDoesNotMakeTheModelYounger) {
  ASSERT_TRUE(
      add(open(), document(1), {.accepted = true}, actor("calibrate otf", kNow - 24h), kNow));
  EXPECT_EQ(fresh_state(open()).model->active_since, kNow - 24h);
}

TEST_F(ModelAuthorityTest, AWallClockThatWasSetBackDoesNotMakeAnAgeNegative) {
  ASSERT_TRUE(
      add(open(), document(1), {.accepted = true}, actor("calibrate otf", kNow + 1h), kNow));
  EXPECT_EQ(fresh_state(open()).model->active_since, kNow);
}

}  // namespace
}  // namespace abbe::daemon
