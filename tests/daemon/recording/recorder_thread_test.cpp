#include "abbe/recording/recorder_thread.hpp"

#include <gmock/gmock.h>

#include <map>

#include "failing_disk.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

using protocol::SampleFlag;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

// Places of the devices in Batch::raw.
constexpr std::size_t kTracker = 0, kEncoder = 1, kProbe = 2, kReference = 3, kEnvironment = 4;

class RecorderThreadTest : public ::testing::Test {
 protected:
  void start(std::size_t most_waiting_bytes) {
    RecorderThreadOptions options;
    options.recorder = example_options(folder_.path());
    options.devices.environment = {"air", "scales"};
    options.devices.all = {"tracker", "encoder", "probe", "reference_card", "air", "scales"};
    options.most_waiting_bytes = most_waiting_bytes;
    auto started = RecorderThread::start(std::move(options), example_info());
    if (!started) throw std::runtime_error(started.error().text);
    thread_ = std::move(*started);
  }
  static protocol::HostTime taken_at(std::uint32_t first) {
    return example_time(first) + std::chrono::seconds{1};
  }
  /// One message of every stream in each of `count` places from `first` on.
  static Batch batch(std::uint32_t first, std::uint32_t count) {
    Batch b;
    b.taken = taken_at(first);
    for (std::uint32_t i = first; i < first + count; ++i) {
      b.points.push_back(example_point(i));
      b.points.back().head.lost_before = 0;
      b.axes.push_back(example_axes(i));
      b.environment.push_back(example_environment(i));
      for (const std::size_t device : {kTracker, kEncoder}) {
        b.raw.push_back({device, example_block(i)});
        b.raw.back().block.lost_before = 0;
      }
    }
    return b;
  }
  /// The recorder has taken everything that waited.
  void wait_until_written() { (void)thread_->digest().get(); }
  [[nodiscard]] RecordingReader finish() {
    thread_.reset();
    auto reader = RecordingReader::open(folder_.path() / "run.mcap");
    if (!reader) throw std::runtime_error(reader.error().text);
    return std::move(*reader);
  }

  TemporaryFolder folder_;
  std::unique_ptr<RecorderThread> thread_;
};

TEST_F(RecorderThreadTest, RecordsWhatItIsHanded) {
  start(1 << 20);
  thread_->hand_over(batch(0, 10));
  EXPECT_EQ(finish().message_count(), 50u);
}

TEST_F(RecorderThreadTest, ReportsHowFarTheFileIsBehindWhileTheDiskStalls) {
  using namespace std::chrono_literals;
  const auto in_31_s = [] { return Recorder::WallTime::clock::now() + 31s; };
  test::SlowDisk disk{SYS_pwrite64};
  if (!disk.start([this] { start(1 << 20); })) GTEST_SKIP() << "no seccomp filter here";
  EXPECT_EQ(thread_->behind(in_31_s()), 0s);
  thread_->hand_over(batch(0, 10));
  EXPECT_GE(thread_->behind(in_31_s()), 31s) << "waits for the recorder, or in the open chunk";
  for (int cycle = 0; cycle < 2; ++cycle) wait_until_written();
  EXPECT_EQ(thread_->behind(in_31_s()), 0s);

  disk.stall();
  thread_->hand_over(batch(10, 10));
  disk.wait_until_held();
  thread_->hand_over(batch(20, 10));
  EXPECT_GE(thread_->behind(in_31_s()), 31s);
  EXPECT_EQ(thread_->status().state, RecorderStatus::State::Recording);
  disk.go_on();
  for (int cycle = 0; cycle < 2; ++cycle) wait_until_written();
  EXPECT_EQ(thread_->behind(in_31_s()), 0s);
  EXPECT_EQ(finish().message_count(), 150u);
}

TEST_F(RecorderThreadTest, EveryMessageCarriesTheCycleInWhichItWasTaken) {
  start(1 << 20);
  for (const std::uint32_t first : {0u, 10u}) {
    Batch b = batch(first, 2);
    b.touches.push_back(example_touch(first));
    b.touch_scans.push_back(example_touch_scan(first));
    for (const std::size_t device : {0u, 1u}) {
      b.measured_environment.push_back({device, example_environment(first)});
      b.raw.push_back({kEnvironment + device, example_block(first)});
    }
    b.raw.push_back({kProbe, example_block(first)});
    b.raw.push_back({kReference, example_block(first)});
    thread_->hand_over(b);
  }

  const auto reader = finish();
  auto cursor = reader.messages();
  std::map<protocol::HostTime, int> messages_of_cycle;

  while (const auto message = cursor.next()) {
    ++messages_of_cycle[message->taken];
    EXPECT_LT(message->published, message->taken) << "what was measured before";
  }

  EXPECT_THAT(messages_of_cycle,
              testing::ElementsAre(std::pair{taken_at(0), 18}, std::pair{taken_at(10), 18}));
}

TEST_F(RecorderThreadTest, MessagesThatDoNotFitAreCountedWithTheirRawBlocks) {
  start(1000);
  thread_->hand_over(batch(0, 100));
  EXPECT_EQ(thread_->dropped(), 500u);
  thread_.reset();
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "run.mcap")) << "it would hold nothing";
}

TEST_F(RecorderThreadTest, ABlockTakesTheSpaceOfItsBytesOnly) {
  start(20'000);  // ten RawBlocks
  Batch b;
  for (std::uint32_t i = 0; i < 100; ++i) b.raw.push_back({kEncoder, example_block(i)});
  thread_->hand_over(b);
  EXPECT_EQ(thread_->dropped(), 0u);
  EXPECT_EQ(finish().message_count(), 100u);
}

/// `count` samples and their bytes of one device of [[environment]].
Batch measured(std::size_t device, std::uint32_t first, std::uint32_t count) {
  Batch b;
  for (std::uint32_t i = first; i < first + count; ++i) {
    b.measured_environment.push_back({device, example_environment(i)});
    b.raw.push_back({kEnvironment + device, example_block(i)});
    b.raw.back().block.lost_before = 0;
  }
  return b;
}

TEST_F(RecorderThreadTest, RecordsEnvironmentDevicesUnderTheirNames) {
  start(1 << 20);
  thread_->hand_over(measured(1, 0, 2));
  thread_->hand_over(measured(0, 2, 1));
  std::map<std::string, int, std::less<>> samples, blocks;
  RecordingSink sink;

  sink.environment = [&](const protocol::EnvironmentSample&, std::string_view d) {
    ++samples[std::string{d}];
  };

  sink.raw_block = [&](const protocol::RawBlock&, std::string_view d) { ++blocks[std::string{d}]; };
  EXPECT_EQ(finish().read(sink), 0u);
  const std::map<std::string, int, std::less<>> expected{{"air", 1}, {"scales", 2}};
  EXPECT_EQ(samples, expected);
  EXPECT_EQ(blocks, expected);
}

TEST_F(RecorderThreadTest, EveryEnvironmentDeviceReportsItsOwnLosses) {
  start(2'000);
  thread_->hand_over(measured(1, 0, 100));  // too much at once
  EXPECT_EQ(thread_->dropped(), 200u);
  wait_until_written();
  thread_->hand_over(measured(0, 100, 1));
  thread_->hand_over(measured(1, 100, 2));
  std::vector<std::pair<std::string, bool>> samples;
  std::vector<std::pair<std::string, std::uint32_t>> blocks;
  RecordingSink sink;

  sink.environment = [&](const protocol::EnvironmentSample& e, std::string_view d) {
    samples.emplace_back(d, has(e.head.flags, SampleFlag::GapBefore));
  };

  sink.raw_block = [&](const protocol::RawBlock& b, std::string_view d) {
    blocks.emplace_back(d, b.lost_before);
  };

  EXPECT_EQ(finish().read(sink), 0u);
  EXPECT_THAT(samples, UnorderedElementsAre(Pair("air", false), Pair("scales", true),
                                            Pair("scales", false)));
  EXPECT_THAT(blocks,
              UnorderedElementsAre(Pair("air", 0u), Pair("scales", 100u), Pair("scales", 0u)));
}

TEST_F(RecorderThreadTest, TheNextMessageOfEveryStreamStatesHowManyAreMissing) {
  start(10'000);
  thread_->hand_over(batch(0, 2));
  thread_->hand_over(batch(2, 100));  // too much at once
  wait_until_written();
  thread_->hand_over(batch(102, 2));
  std::vector<std::uint32_t> points, axes, tracker_raw, encoder_raw;
  std::vector<bool> environment;
  RecordingSink sink;

  sink.tracker_point = [&](const protocol::TrackerPoint& p, std::string_view) {
    points.push_back(p.head.lost_before);
  };

  sink.axis_sample = [&](const protocol::AxisSample& a, std::string_view) {
    axes.push_back(a.head.lost_before);
    EXPECT_EQ(has(a.head.flags, SampleFlag::GapBefore), a.head.lost_before > 0);
  };

  sink.environment = [&](const protocol::EnvironmentSample& e, std::string_view) {
    environment.push_back(has(e.head.flags, SampleFlag::GapBefore));
  };

  sink.raw_block = [&](const protocol::RawBlock& b, std::string_view device) {
    (device == "tracker" ? tracker_raw : encoder_raw).push_back(b.lost_before);
  };

  EXPECT_EQ(finish().read(sink), 0u);
  const std::vector<std::uint32_t> expected{0, 0, 100, 0};
  EXPECT_EQ(points, expected);
  EXPECT_EQ(axes, expected);
  EXPECT_EQ(tracker_raw, expected);
  EXPECT_EQ(encoder_raw, expected);
  EXPECT_EQ(environment, (std::vector<bool>{false, false, true, false}));
}

TEST_F(RecorderThreadTest, LossesThatADroppedSampleReportedAreAmongTheMissing) {
  start(10'000);
  Batch too_much = batch(0, 100);
  too_much.axes[40].head.lost_before = 7;
  too_much.raw.back().block.lost_before = 3;  // of the encoder
  thread_->hand_over(too_much);
  EXPECT_EQ(thread_->dropped(), 500u) << "losses before the recorder are not its own";
  wait_until_written();
  thread_->hand_over(batch(100, 1));

  std::vector<std::uint32_t> axes, encoder_raw;
  RecordingSink sink;

  sink.axis_sample = [&](const protocol::AxisSample& a, std::string_view) {
    axes.push_back(a.head.lost_before);
  };

  sink.raw_block = [&](const protocol::RawBlock& b, std::string_view device) {
    if (device == "encoder") encoder_raw.push_back(b.lost_before);
  };

  EXPECT_EQ(finish().read(sink), 0u);
  EXPECT_EQ(axes, std::vector<std::uint32_t>{100 + 7});
  EXPECT_EQ(encoder_raw, std::vector<std::uint32_t>{100 + 3});
}

}  // namespace
}  // namespace abbe::daemon
