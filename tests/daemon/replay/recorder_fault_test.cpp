// What becomes of a recording, its requests and its status when the disk or the recorder fails.

#include <gmock/gmock.h>

#include <filesystem>

#include "abbe/methods/calibration_request.hpp"
#include "abbe/recording/recorder_thread.hpp"
#include "failing_disk.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using State = RecorderStatus::State;
using WallTime = Recorder::WallTime;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class RecorderFault : public ::testing::Test {
 protected:
  RecorderFault() : recorder_(open()) {}
  Recorder open() {
    auto opened = Recorder::open(example_options(folder_.path()), example_info(), WallTime{100s});
    if (!opened) throw std::runtime_error(opened.error().text);
    return std::move(*opened);
  }
  static RecordingAttachment request() {
    return to_attachment(
        CalibrationRequest{.task = OtfRequest{{{0, 0, 0}, {1, 0, 0}}}, .from = example_time(0)});
  }
  void end_calibration(const std::string& state) {
    auto event = example_event(1);
    event.state(state);
    recorder_.record(event);
  }
  /// Where the requests of a file are.
  std::size_t requests_in(const std::string& name) {
    const auto reader = RecordingReader::open(folder_.path() / name);
    if (!reader) throw std::runtime_error(reader.error().text);
    return static_cast<std::size_t>(std::ranges::count_if(
        reader->attachments(), [](const auto& a) { return is_calibration_request(a.name); }));
  }
  [[nodiscard]] bool exists(const std::string& name) const {
    return std::filesystem::exists(folder_.path() / name);
  }

  TemporaryFolder folder_;
  Recorder recorder_;
};

TEST_F(RecorderFault, ARecordingThatIsClosedWholeHasNoGap) {
  record_example(recorder_, 1);
  const auto closed = recorder_.close();
  ASSERT_TRUE(closed) << closed.error().text;
  EXPECT_GT(closed->bytes, 0u);
  EXPECT_THAT(closed->gap, IsEmpty());
}

TEST_F(RecorderFault, AfterAFailedFdatasyncTheFileCountsAsDamagedAndANewOneIsBegun) {
  record_example(recorder_, 1);
  recorder_.flush();
  test::while_failing(SYS_fdatasync, [&] { recorder_.tick(WallTime{102s}); });
  EXPECT_EQ(recorder_.status().state, State::Failed);
  EXPECT_THAT(recorder_.status().fault, HasSubstr("fdatasync"));
  EXPECT_TRUE(exists("run.damaged.mcap")) << "that the next fsync succeeds proves nothing";
  EXPECT_FALSE(exists("run.mcap"));
  recorder_.tick(WallTime{108s});
  EXPECT_EQ(recorder_.status().state, State::Recording);
  EXPECT_EQ(recorder_.status().file.filename(), "run-2.mcap.part");
}

TEST_F(RecorderFault, AFailedFsyncAtTheEndMakesTheFileDamaged) {
  record_example(recorder_, 1);
  test::while_failing(SYS_fsync, [&] {
    const auto closed = recorder_.close();
    EXPECT_FALSE(closed);
  });
  EXPECT_TRUE(exists("run.damaged.mcap"));
  EXPECT_FALSE(exists("run.mcap"));
}

TEST_F(RecorderFault, StaysAsTheLastFaultWhenRecordingGoesOn) {
  recorder_.fail("recorder: out of memory");
  for (int i = 0; i < 10; ++i) recorder_.tick(WallTime{100s + i * 20ms});
  EXPECT_EQ(recorder_.status().state, State::Failed);
  EXPECT_EQ(recorder_.status().fault, "recorder: out of memory");
  recorder_.tick(WallTime{106s});
  EXPECT_EQ(recorder_.status().state, State::Recording);
  EXPECT_THAT(recorder_.status().fault, IsEmpty());
  EXPECT_EQ(recorder_.status().last_fault,
            "recorder: out of memory; over: recording continues in " +
                recorder_.status().file.filename().string());
  EXPECT_EQ(recorder_.status().faults, 1u);
}

TEST_F(RecorderFault, TheNextFileDoesNotAskAgainForACalibrationThatIsOver) {
  recorder_.attach(request(), example_time(0));
  record_example(recorder_, 1);
  end_calibration("active");
  recorder_.flush();
  recorder_.fail("test");
  recorder_.tick(WallTime{106s});
  ASSERT_EQ(recorder_.status().state, State::Recording);
  record_example(recorder_, 2);
  ASSERT_TRUE(recorder_.close());
  EXPECT_EQ(requests_in("run.mcap"), 1u);
  EXPECT_EQ(requests_in("run-2.mcap"), 0u);
}

TEST_F(RecorderFault, TheNextFileAsksForTheCalibrationThatIsRunning) {
  recorder_.attach(request(), example_time(0));
  record_example(recorder_, 1);
  end_calibration("refused");
  recorder_.attach(request(), example_time(5));
  record_example(recorder_, 6);
  recorder_.flush();
  recorder_.fail("test");
  recorder_.tick(WallTime{106s});
  record_example(recorder_, 7);
  ASSERT_TRUE(recorder_.close());
  EXPECT_EQ(requests_in("run-2.mcap"), 1u);
}

TEST_F(RecorderFault, TheDigestStatesWhatTheRecordingLacksOfTheRun) {
  recorder_.attach(request(), example_time(0));
  record_example(recorder_, 1);
  recorder_.flush();
  EXPECT_THAT(recorder_.digest().gap, IsEmpty());
  recorder_.fail("test");
  EXPECT_THAT(recorder_.digest().gap, HasSubstr("nothing is recorded: test"));
  recorder_.tick(WallTime{106s});
  EXPECT_THAT(recorder_.digest().gap, HasSubstr("interrupted during the run"));
  end_calibration("active");
  recorder_.attach(request(), example_time(8));
  EXPECT_THAT(recorder_.digest().gap, IsEmpty()) << "the next run is whole";
}

TEST(RecorderThreadFault, MessagesThatWereDroppedDuringTheRunAreInItsDigest) {
  const TemporaryFolder folder;
  RecorderThreadOptions options;
  options.recorder = example_options(folder.path());
  options.most_waiting_bytes = 1000;
  auto thread = RecorderThread::start(std::move(options), example_info());

  ASSERT_TRUE(thread);
  Batch batch;
  for (std::uint32_t i = 0; i < 100; ++i) batch.axes.push_back(example_axes(i));
  (*thread)->hand_over(batch);
  (*thread)->attach({.name = "calibration-otf.json"}, example_time(0));
  EXPECT_THAT((*thread)->digest().get().gap, IsEmpty()) << "that was before the run";
  (*thread)->hand_over(batch);
  EXPECT_EQ((*thread)->digest().get().gap, "100 messages of the run are missing");
}

}  // namespace
}  // namespace abbe::daemon
