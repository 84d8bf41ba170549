#include "abbe/pipeline/counting_state.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>

#include "abbe/service/background_tasks.hpp"
#include "abbe/service/counting_state_thread.hpp"
#include "abbe/service/reference_service.hpp"
#include "config_tables.hpp"
#include "failing_disk.hpp"
#include "reference_cycle.hpp"
#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;
using protocol::HostTime;
using protocol::SampleFlag;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kBoot = "7d2b";

Config card_config(const std::string& x_step_nm = "250") {
  auto config =
      parse_config(to_toml(config_tables::half_metre_mill()) +
                       "[counter_card]\ntransport = \"usbip\"\nport = 3240\nzero = \"here\"\n"
                       "axes = [{axis = \"X\", channel = 0, step_nm = " +
                       x_step_nm +
                       "}, {axis = \"Y\", channel = 1, step_nm = 250},\n"
                       "        {axis = \"Z\", channel = 2, step_nm = 250}]\n",
                   "abbed.toml");
  EXPECT_TRUE(config) << config.error().details.front();
  return *config;
}

Counting some_counting() {
  Counting counting;
  counting.progress.head.time = HostTime{100s};
  counting.progress.clock_count = (std::int64_t{1} << 33) + 5;
  counting.progress.axis_count = 3;
  counting.progress.count = {1, -2, 3};
  counting.progress.set_serial_number("01ABBE08");
  counting.zero = {{.axis = 0, .reading_at_zero = 0.1 + 1e-17, .u = 1e-6},
                   {.axis = 2, .reading_at_zero = -0.3, .u = 1e-4, .stated = true}};
  return counting;
}

/// A data directory in which a run left its state.
class LeftCountingTest : public ::testing::Test {
 protected:
  LeftCountingTest() : config_(card_config()) { config_.daemon.data_dir = folder_.path(); }
  void leave(const std::string& text) const { test::write_text(file(), text); }
  [[nodiscard]] CountingState state() const {
    return {.boot_id = kBoot, .set_up = counting_set_up(config_), .counting = some_counting()};
  }
  [[nodiscard]] fs::path file() const { return counting_state_file(folder_.path()); }

  TemporaryFolder folder_;
  Config config_;
};

TEST_F(LeftCountingTest, ReadsBackTheStoredState) {
  leave(to_text(state()));
  const auto left = left_counting(config_, kBoot);
  ASSERT_TRUE(left.state) << left.warning;
  const auto& progress = left.state->counting.progress;
  EXPECT_EQ(progress.head.time, HostTime{100s});
  EXPECT_EQ(progress.clock_count, (std::int64_t{1} << 33) + 5);
  EXPECT_EQ(progress.count, some_counting().progress.count);
  EXPECT_EQ(progress.serial_number(), "01ABBE08");
  ASSERT_EQ(left.state->counting.zero.size(), 2u);
  EXPECT_EQ(left.state->counting.zero[0].reading_at_zero, 0.1 + 1e-17);
  EXPECT_TRUE(left.state->counting.zero[1].stated);
}

TEST_F(LeftCountingTest, WithoutAFileReportsNothing) {
  const auto left = left_counting(config_, kBoot);
  EXPECT_FALSE(left.state);
  EXPECT_THAT(left.warning, IsEmpty());
}

TEST_F(LeftCountingTest, RemovesThePartialFileOfAKilledRun) {
  const fs::path half = file().string() + ".4711.new";
  test::write_text(half, "{");
  leave(to_text(state()));
  EXPECT_TRUE(left_counting(config_, kBoot).state);
  EXPECT_FALSE(fs::exists(half));
}

TEST_F(LeftCountingTest, IsValidForTheSameBootOnly) {
  leave(to_text(state()));
  EXPECT_THAT(left_counting(config_, "9c01").warning,
              HasSubstr("this computer was restarted since"));
  EXPECT_THAT(left_counting(config_, "").warning,
              HasSubstr("boot id of this computer cannot be read"));
  EXPECT_FALSE(left_counting(config_, "").state);
}

TEST_F(LeftCountingTest, IsValidForTheSameSetUpOnly) {
  leave(to_text(state()));
  auto changed = card_config("500");
  changed.daemon.data_dir = folder_.path();
  const auto left = left_counting(changed, kBoot);
  EXPECT_FALSE(left.state);
  EXPECT_THAT(left.warning, HasSubstr("the set-up of the card was changed (axes)"));
}

TEST_F(LeftCountingTest, ADamagedFileIsRenamedAndKept) {
  auto text = to_text(state());
  text[text.find("-0.3") + 3] = '4';
  leave(text);
  const auto left = left_counting(config_, kBoot);
  EXPECT_FALSE(left.state);
  EXPECT_THAT(left.warning, HasSubstr("its checksum is wrong"));
  EXPECT_THAT(left.warning, HasSubstr("not referenced"));
  EXPECT_FALSE(fs::exists(file()));
  EXPECT_EQ(test::text_of(file().string() + ".damaged"), text);
}

TEST_F(LeftCountingTest, APathThatIsNoRegularFileIsRenamedToo) {
  fs::create_directory(file());
  EXPECT_THAT(left_counting(config_, kBoot).warning, HasSubstr("is not a regular file"));
  EXPECT_TRUE(fs::is_directory(file().string() + ".damaged"));
}

protocol::AxisSample counted_sample(HostTime at, bool restarted = false) {
  protocol::AxisSample sample;
  sample.head.time = at;
  if (restarted) sample.head.flags |= SampleFlag::Restarted;
  sample.axis_count = 3;
  sample.count = {1, -2, 3};
  return sample;
}

TEST(ReferenceAfterARestart, RestoresTheZeroOfACardThatKeptCounting) {
  const auto config = card_config();
  ReferenceService service{config, nullptr, some_counting()};
  Batch batch;
  batch.axes.push_back(counted_sample(HostTime{110s}));
  give(service, batch);
  EXPECT_EQ(batch.axes[0].missing_mask, 0b010)
      << "Y was not referenced, and zero = \"here\" is over";
  EXPECT_DOUBLE_EQ(batch.axes[0].position[0], 0.1 + 250e-9);
  EXPECT_THAT(service.carried_on(), ElementsAre("X", "Z"));
}

TEST(ReferenceAfterARestart, DropsTheZeroOfACardThatRestarted) {
  const auto config = card_config();
  ReferenceService service{config, nullptr, some_counting()};
  Batch batch;
  batch.axes.push_back(counted_sample(HostTime{110s}, true));
  give(service, batch);
  EXPECT_EQ(batch.axes[0].missing_mask, 0) << "zero = \"here\" holds for the first set-up";
  EXPECT_DOUBLE_EQ(batch.axes[0].position[0], 250e-9);
  EXPECT_THAT(service.carried_on(), IsEmpty());
}

TEST(ReferenceAfterARestart, DropsTheProgressFromBeforeTheCountersRestarted) {
  const auto config = card_config();
  ReferenceService service{config, nullptr};
  const auto cycle = [&service](const protocol::AxisSample& sample, HostTime progress) {
    Batch batch;
    batch.axes.push_back(sample);
    give(service, batch);
    auto counting = some_counting().progress;
    counting.head.time = progress;
    service.take(counting);
  };

  cycle(counted_sample(HostTime{1s}, true), HostTime{1s});
  ASSERT_TRUE(service.counting());
  EXPECT_EQ(service.counting()->zero.size(), 3u);
  cycle(counted_sample(HostTime{5s}), HostTime{6s});  // of a scan that is not among the samples yet

  EXPECT_EQ(service.counting()->progress.head.time, HostTime{1s});
  cycle(counted_sample(HostTime{7s}, true), HostTime{6s});
  EXPECT_FALSE(service.counting());
}

TEST(CountingStateThread, WritesAtTheLatestWhenItEnds) {
  const TemporaryFolder folder;
  const auto file = counting_state_file(folder.path() / "data");
  std::vector<std::string> faults;

  {
    const CountingStateThread thread{
        file,
        [] { return CountingState{.boot_id = kBoot, .set_up = "{}", .counting = some_counting()}; },
        [&faults](const std::string& fault) { faults.push_back(fault); }, 1h};
  }

  const auto state = counting_state_from_text(test::text_of(file), "kept");
  ASSERT_TRUE(state) << state.error().text;
  EXPECT_EQ(state->counting.zero.size(), 2u);
  EXPECT_THAT(faults, IsEmpty());
}

TEST(CountingStateThread, ReportsADiskThatRefusesOnce) {
  const TemporaryFolder folder;
  test::write_text(folder.path() / "data", "in the way");
  std::vector<std::string> faults;
  {
    const CountingStateThread thread{
        counting_state_file(folder.path() / "data"),
        [] { return CountingState{.boot_id = kBoot, .set_up = "{}", .counting = some_counting()}; },
        [&faults](const std::string& fault) { faults.push_back(fault); }, 1h};
  }
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_THAT(faults[0], HasSubstr("would not be referenced"));
}

TEST(CountingStateThread, ADiskThatDoesNotRespondDoesNotDelayTheEnd) {
  const TemporaryFolder folder;
  std::vector<std::string> faults;
  std::atomic<int> disk{-1};
  const auto begun = std::chrono::steady_clock::now();

  {
    const CountingStateThread thread{
        counting_state_file(folder.path() / "data"),
        [&disk] {
          disk = test::make_stall(SYS_fsync);
          return CountingState{.boot_id = kBoot, .set_up = "{}", .counting = some_counting()};
        },
        [&faults](const std::string& fault) { faults.push_back(fault); }, 1h};
  }

  EXPECT_LT(std::chrono::steady_clock::now() - begun, CountingStateThread::kEndTimeout + 1s);
  if (disk < 0) GTEST_SKIP() << "no seccomp listener";
  EXPECT_THAT(faults, testing::ElementsAre(HasSubstr("its disk has not answered for 3 s")));
  EXPECT_TRUE(background_tasks_running());
  ::close(disk);
  while (background_tasks_running()) std::this_thread::yield();
  EXPECT_EQ(faults.size(), 1u);
}

}  // namespace
}  // namespace abbe::daemon
