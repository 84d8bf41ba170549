// What becomes of a model that was identified while disk, store or recorder failed.

#include "abbe/service/calibration_service.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/file.h>
#include <unistd.h>

#include <fstream>
#include <limits>
#include <thread>

#include "abbe/base/exit_deadline.hpp"
#include "abbe/service/background_tasks.hpp"
#include "synthetic_otf_run.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using protocol::HostTime;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

class UnstoredModel : public ::testing::Test {
 protected:
  UnstoredModel() : config_(parse_config(test::synthetic_machine_toml(), "machine.toml").value()) {
    fs::remove_all(folder_);
  }
  ~UnstoredModel() override { fs::remove_all(folder_); }

  void start(RecorderThread* recorder = nullptr) {
    authority_.emplace(ModelAuthority::open(folder_ / "models", config_, {}, now_));
    service_.emplace(config_, *authority_, recorder);
    ASSERT_TRUE(service_->start(OtfRequest{test::synthetic_request_path_m()}, "anna", now_));
  }
  void drive() {
    for (const auto& point : test::synthetic_points(0.4, 2.0)) {
      now_ = HostTime{100s} + std::chrono::duration_cast<std::chrono::nanoseconds>(
                                  std::chrono::duration<double>(point.time_s));
      protocol::Snapshot s;
      s.head.time = now_;
      s.axis_count = 3;
      s.has_tracker_point = true;
      s.tracker_point.device_time = protocol::DeviceTime{now_.time_since_epoch()};
      for (std::size_t a = 0; a < 3; ++a) {
        s.position[a] = point.q_m[static_cast<Eigen::Index>(a)];
        s.tracker_point.p_tracker_m[a] = point.p_tracker_m[static_cast<Eigen::Index>(a)];
      }
      (void)service_->cycle({&s, 1}, now_);
    }
  }
  /// Until what runs on the other threads has come to `done`.
  template <class Done>
  void cycle_until(Done done) {
    while (!done()) {
      (void)service_->cycle({}, now_);
      std::this_thread::yield();
    }
  }
  /// As a full disk or a missing permission: a file is where the models belong.
  void block_store() const {
    fs::remove(folder_ / "models" / "models");
    std::ofstream{folder_ / "models" / "models"} << "in the way";
  }
  void free_store() const { fs::remove(folder_ / "models" / "models"); }
  /// With a model that waits for the store, as abbed does after SIGTERM.
  [[noreturn]] void end_while_the_lock_is_held() {
    start();
    block_store();
    drive();
    cycle_until([this] { return !service_->session().not_stored().empty(); });
    free_store();
    const int lock =
        ::open((folder_ / "models" / "lock").c_str(), O_RDONLY | O_CREAT | O_CLOEXEC, 0600);
    const bool held = ::flock(lock, LOCK_EX) == 0;
    const ExitDeadline deadline{5s, 70, "the end was held up\n"};
    service_.reset();
    ::_exit(held ? 0 : 1);
  }
  [[nodiscard]] SessionState state() const { return service_->status().state; }
  void cycle_until_over() {
    cycle_until(
        [this] { return state() == SessionState::Active || state() == SessionState::Refused; });
  }
  [[nodiscard]] ModelDocument stored() const {
    const auto store = ModelStore::open(folder_ / "models").value();
    return store.load(store.list().value().front().id).value();
  }

  fs::path folder_ =
      fs::path(::testing::TempDir()) /
      (std::string("unstored_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
  Config config_;
  HostTime now_{100s};
  std::optional<ModelAuthority> authority_;
  std::optional<CalibrationService> service_;
};

TEST_F(UnstoredModel, AModelTheStoreDoesNotTakeIsKeptTriedAgainAndReported) {
  start();
  block_store();
  drive();
  cycle_until([this] { return !service_->session().not_stored().empty(); });

  EXPECT_EQ(state(), SessionState::Identifying);
  EXPECT_THAT(service_->session().not_stored(), HasSubstr("is not stored"));
  EXPECT_THAT(service_->status().reason, HasSubstr("tried again every 5 s"));
  free_store();
  now_ += 4s;
  for (int i = 0; i < 3; ++i) (void)service_->cycle({}, now_);
  EXPECT_THAT(service_->session().not_stored(), Not(IsEmpty())) << "not before its time";
  now_ += 1s;
  cycle_until_over();
  EXPECT_EQ(state(), SessionState::Active) << service_->status().reason;
  EXPECT_THAT(service_->session().not_stored(), IsEmpty());
  EXPECT_EQ(authority_->active_model()->id, model_id(stored()));
}

TEST_F(UnstoredModel, OneBackgroundTaskIdentifiesStoresAndActivatesTheModel) {
  start();
  drive();
  while (background_tasks_running()) std::this_thread::yield();
  const auto activation = ModelStore::open(folder_ / "models").value().activation().value();
  ASSERT_TRUE(activation) << "stored without a further cycle of the hub";
  EXPECT_EQ(activation->actor.who, "anna");
  cycle_until_over();  // the result is handed over after the task was destroyed
  EXPECT_EQ(state(), SessionState::Active) << service_->status().reason;
  EXPECT_EQ(authority_->active_model()->id, activation->id);
}

TEST_F(UnstoredModel, CancelDiscardsAModelTheStoreDoesNotTake) {
  start();
  block_store();
  drive();
  cycle_until([this] { return !service_->session().not_stored().empty(); });
  ASSERT_TRUE(service_->cancel("anna", now_));
  EXPECT_EQ(state(), SessionState::Refused);
  EXPECT_THAT(service_->session().not_stored(), IsEmpty());
  free_store();
  now_ += 10s;
  (void)service_->cycle({}, now_);
  EXPECT_THAT(ModelStore::open(folder_ / "models").value().list().value(), IsEmpty());
}

/// A wait for the store's lock is limited as for a disk that stalls: at most 5 s of real time.
TEST_F(UnstoredModel, CancelDiscardsAModelWhileTheStoreDoesNotRespond) {
  start();
  const int lock =
      ::open((folder_ / "models" / "lock").c_str(), O_RDONLY | O_CREAT | O_CLOEXEC, 0600);
  ASSERT_EQ(::flock(lock, LOCK_EX), 0);
  drive();
  cycle_until([this] { return service_->session().held_out().has_value(); });
  const auto early = service_->cancel("anna", now_);
  ASSERT_FALSE(early);
  EXPECT_THAT(early.error().text, HasSubstr("already being stored"));
  now_ += 6s;
  (void)service_->cycle({}, now_);
  EXPECT_THAT(service_->session().not_stored(), HasSubstr("the store has not answered for 5 s"));
  EXPECT_THAT(service_->status().reason, HasSubstr("cancel discards it"));
  const auto cancelled = service_->cancel("anna", now_);
  ASSERT_TRUE(cancelled) << cancelled.error().text;
  EXPECT_EQ(state(), SessionState::Refused);
  EXPECT_THAT(service_->status().reason,
              HasSubstr("cancelled by anna; the store does not answer and may still"));
  EXPECT_THAT(service_->session().not_stored(), IsEmpty());
  const OtfRequest next{test::synthetic_request_path_m()};
  EXPECT_TRUE(service_->start(next, "anna", now_)) << "the next calibration";

  ::close(lock);
  while (background_tasks_running()) std::this_thread::yield();
  (void)service_->cycle({}, now_);
  EXPECT_NE(state(), SessionState::Active);
  EXPECT_FALSE(ModelStore::open(folder_ / "models").value().activation().value());
}

TEST_F(UnstoredModel, TheEndOfTheDaemonTriesOnceMoreToStoreTheModel) {
  start();
  block_store();
  drive();
  cycle_until([this] { return !service_->session().not_stored().empty(); });
  free_store();
  service_.reset();
  EXPECT_THAT(ModelStore::open(folder_ / "models").value().list().value(), SizeIs(1));
}

TEST_F(UnstoredModel, TheEndOfTheDaemonIsNotDelayedByTheStoresLock) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(end_while_the_lock_is_held(), ::testing::ExitedWithCode(0),
              "is lost: lock the model store .* has held it for 1 s");
}

TEST_F(UnstoredModel, AModelWhoseIdentificationHasJustEndedIsStoredAtTheEndOfTheDaemon) {
  start();
  drive();
  while (service_->status().progress < 1.0)
    std::this_thread::yield();  // nothing looks at its outcome
  service_.reset();
  EXPECT_THAT(ModelStore::open(folder_ / "models").value().list().value(), SizeIs(1));
}

TEST_F(UnstoredModel, AModelWhoseRunIsNotRecordedIsActiveAndMarkedAsNotReplayable) {
  RecorderThreadOptions options;
  options.recorder.directory = folder_ / "recordings";
  options.recorder.name = "abbe-full";
  options.recorder.min_free_bytes = std::numeric_limits<std::uint64_t>::max() / 2;
  auto recorder = RecorderThread::start(std::move(options), {.machine = "mill"});

  ASSERT_TRUE(recorder);
  start(recorder->get());
  drive();
  cycle_until_over();
  ASSERT_EQ(state(), SessionState::Active) << service_->status().reason;
  EXPECT_THAT(service_->status().reason,
              HasSubstr("no replay can check this model: nothing is recorded"));
  const auto document = stored();
  EXPECT_THAT(document.recording_gap, HasSubstr("nothing is recorded"));
  EXPECT_THAT(document.inputs, SizeIs(1)) << "no recording of 0 bytes is cited";
  EXPECT_EQ(document.inputs.front().name, "points");
}

TEST_F(UnstoredModel, AWholeRecordingIsWhatTheModelIsIdentifiedFrom) {
  RecorderThreadOptions options;
  options.recorder.directory = folder_ / "recordings";
  options.recorder.name = "abbe-whole";
  auto recorder = RecorderThread::start(std::move(options), {.machine = "mill"});
  ASSERT_TRUE(recorder);
  start(recorder->get());
  drive();
  cycle_until_over();
  ASSERT_EQ(state(), SessionState::Active) << service_->status().reason;
  EXPECT_THAT(stored().recording_gap, IsEmpty());
  EXPECT_THAT(stored().inputs.front().name, HasSubstr("abbe-whole.mcap.part"));
  EXPECT_THAT(stored().inputs.front().sha256, SizeIs(64));
}

}  // namespace
}  // namespace abbe::daemon
