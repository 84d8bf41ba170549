/// A recording cut into several files: each of them stands for itself.

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <set>

#include "abbe/pipeline/axis_zero.hpp"
#include "abbe/replay/replay.hpp"
#include "config_tables.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using ::testing::ElementsAre;

const std::string kTrackerMill = to_toml(config_tables::half_metre_mill()) + R"([tracker]
host = "127.0.0.1"
[counter_card]
transport = "usbip"
port = 3240
zero = "here"
axes = [{axis = "X", channel = 0, step_nm = 250}, {axis = "Y", channel = 1, step_nm = 250},
        {axis = "Z", channel = 2, step_nm = 250}]
)";

class FurtherFiles : public ::testing::Test {
 protected:
  FurtherFiles() {
    auto options = example_options(folder_.path());
    options.max_file_bytes = 1;  // every flush, tick and attachment ends one that holds something
    options.chunk_bytes = 2048;
    auto opened = Recorder::open(options, example_info(), {});
    if (!opened) throw std::runtime_error(opened.error().text);
    recorder_.emplace(std::move(*opened));
  }
  void record_axes(std::uint32_t i, std::uint8_t unknown) {
    auto sample = example_axes(i);
    sample.missing_mask = unknown;
    recorder_->record(sample, "counter_card");
  }
  void find_zero(std::size_t axis, double reading_at_zero, HostTime from) {
    recorder_->attach(to_attachment(FoundZero{axis, reading_at_zero, 0.0, from}), from);
  }
  RecordingReader second() {
    if (!recorder_->close()) throw std::runtime_error("close");
    return read("run-2.mcap");
  }
  RecordingReader read(const std::string& name) {
    auto reader = RecordingReader::open(folder_.path() / name);
    if (!reader) throw std::runtime_error(reader.error().text);
    return std::move(*reader);
  }
  /// Instants of the tracker's weather that a replay gives.
  static std::vector<HostTime> weather_of(const RecordingReader& reader, ReplaySource source) {
    const auto config = parse_config(kTrackerMill, "abbed.toml");
    if (!config) throw std::runtime_error(config.error().details.front());
    std::vector<HostTime> times;
    ReplayOptions options{.source = source};
    options.samples = [&](const Batch& batch, HostTime) {
      for (const auto& e : batch.environment) times.push_back(e.head.time);
    };
    EXPECT_TRUE(replay(reader, *config, options));
    return times;
  }
  /// reading_at_zero of the zeros handed on, in order.
  static std::vector<double> zeros_of(const RecordingReader& reader) {
    std::vector<double> zeros;
    for (const auto& a : reader.attachments())
      if (a.name == kZeroName) zeros.push_back(zero_from_attachment(a)->reading_at_zero);
    return zeros;
  }

  TemporaryFolder folder_;
  std::optional<Recorder> recorder_;
};

/// A point of the new file may describe an instant up to the watermark before it.
TEST_F(FurtherFiles, BeginWithTheWeatherThatTheirInstantsNeed) {
  recorder_->record(example_environment(1), "tracker");
  recorder_->record(example_environment(2), "hall");
  auto last = example_environment(3);
  last.head.lost_before = 4;
  last.head.flags |= protocol::SampleFlag::GapBefore;
  recorder_->record(last, "tracker");
  recorder_->flush();
  recorder_->record(example_point(9), "tracker");
  const auto reader = second();
  std::vector<std::string> seen;
  std::vector<HostTime> times;
  RecordingSink sink;

  sink.environment = [&](const protocol::EnvironmentSample& e, std::string_view device) {
    seen.emplace_back(device);
    times.push_back(e.head.time);
    EXPECT_EQ(e.head.lost_before, 0u) << "said where they were lost";
    EXPECT_FALSE(has(e.head.flags, protocol::SampleFlag::GapBefore));
  };

  sink.tracker_point = [&](const protocol::TrackerPoint&, std::string_view) {
    seen.emplace_back("point");
  };

  EXPECT_EQ(reader.read(sink), 0u);
  EXPECT_THAT(seen, ElementsAre("tracker", "hall", "tracker", "point"));
  EXPECT_THAT(times, ElementsAre(example_time(1), example_time(2), example_time(3)));
  EXPECT_EQ(reader.time_range()->first, example_time(9)) << "the file is not as old as its weather";
  EXPECT_EQ(recorder_->status().lost, 0u);
}

TEST_F(FurtherFiles, DoNotRepeatWeatherThatNoInstantNeeds) {
  for (const std::uint32_t ms : {1u, 2'000u, 5'000u})
    recorder_->record(example_environment(ms), "hall");
  recorder_->flush();
  recorder_->record(example_point(5'001), "tracker");
  std::vector<HostTime> times;
  RecordingSink sink;
  sink.environment = [&](const auto& e, std::string_view) { times.push_back(e.head.time); };
  EXPECT_EQ(second().read(sink), 0u);
  EXPECT_THAT(times, ElementsAre(example_time(2'000), example_time(5'000)));
}

TEST_F(FurtherFiles, GiveTheirWeatherToAReplayAlsoFromRawBytes) {
  recorder_->record(example_environment(1), "tracker");
  recorder_->flush();
  recorder_->record(protocol::to_raw_bytes(example_block(9), "somebody"));
  recorder_->record(example_environment(10), "tracker", example_time(12));
  const auto reader = second();
  EXPECT_THAT(weather_of(reader, ReplaySource::Samples),
              ElementsAre(example_time(1), example_time(10)));
  EXPECT_THAT(weather_of(reader, ReplaySource::RawBytes), ElementsAre(example_time(1)))
      << "the other from its bytes";
}

/// Recordings without cycles: log_time is when a message was published, here of message 10 later
/// than it was measured.
TEST_F(FurtherFiles, GiveTheirWeatherAlsoWithoutRecordedCycles) {
  recorder_->record(example_environment(1), "tracker");
  recorder_->flush();
  recorder_->record(example_environment(10), "tracker", example_time(12));
  recorder_->record(example_environment(13), "tracker");

  ASSERT_TRUE(recorder_->close());
  EXPECT_THAT(weather_of(read("run-2.mcap"), ReplaySource::RawBytes), ElementsAre(example_time(1)));
  const auto file = folder_.path() / "run-2.mcap";
  auto bytes = bytes_of_file(file);
  constexpr std::string_view kKey = "log_time";
  const auto key = std::search(bytes.begin(), bytes.end(), kKey.begin(), kKey.end());
  ASSERT_NE(key, bytes.end());
  *key = 'x';
  write_file(file, bytes, bytes.size());
  EXPECT_THAT(weather_of(read("run-2.mcap"), ReplaySource::RawBytes),
              ElementsAre(example_time(1), example_time(10)));
}

/// Three cycles of several chunks each; one chunk fills a file.
TEST_F(FurtherFiles, BeginWithAWholeCycle) {
  for (std::uint32_t turn = 0; turn < 3; ++turn) {
    const HostTime taken = example_time(10 * (turn + 1));
    for (std::uint32_t i = 0; i < 20; ++i) {  // several chunks
      recorder_->record(example_axes(10 * turn), "encoder", taken);
      recorder_->record(example_point(10 * turn), "tracker", taken);
    }
    recorder_->tick({});
  }

  ASSERT_TRUE(recorder_->close());
  std::set<HostTime> turns;
  for (const std::string name : {"run.mcap", "run-2.mcap", "run-3.mcap"}) {
    const auto reader = read(name);
    EXPECT_EQ(reader.message_count(), 40u) << name;
    turns.insert(reader.time_range()->first);
    EXPECT_EQ(reader.time_range()->first, reader.time_range()->second) << name;
  }

  EXPECT_EQ(turns.size(), 3u);
}

TEST_F(FurtherFiles, CarryOverTheValidZerosOnly) {
  recorder_->attach(reference_request(example_time(1)), example_time(1));
  find_zero(0, 0.1, example_time(1));
  find_zero(0, 0.2, example_time(2));
  find_zero(1, 0.3, example_time(3));
  record_axes(5, 0b110);  // Y and Z: the card restarted
  recorder_->flush();
  record_axes(6, 0b110);
  const auto reader = second();

  EXPECT_THAT(zeros_of(reader), ElementsAre(0.2));
  std::vector<std::string> names;
  for (const auto& a : reader.attachments()) names.push_back(a.name);
  EXPECT_THAT(names, ElementsAre(kZeroStateName, kZeroName));
  const auto state = zero_state_from_attachment(reader.attachments().front());
  ASSERT_TRUE(state) << state.error().text;
  EXPECT_EQ(state->at, example_time(5));
  EXPECT_EQ(state->unknown, 0b110);
}

TEST_F(FurtherFiles, CarryOverZerosFoundSinceTheLastSample) {
  find_zero(0, 0.1, example_time(1));
  record_axes(5, 0b110);
  find_zero(1, 0.2, example_time(5));  // what waited fills the first file
  record_axes(5, 0b110);
  recorder_->flush();
  record_axes(6, 0b100);
  EXPECT_THAT(zeros_of(second()), ElementsAre(0.1, 0.2));
  EXPECT_THAT(zeros_of(read("run-3.mcap")), ElementsAre(0.1, 0.2));
}

/// A recording of a card that restarted while its axes moved, in files of some messages each.
class CutRecording : public ::testing::Test {
 protected:
  static constexpr int kMessagesPerFile = 150;

  CutRecording() {
    const auto whole = folder_.path() / "whole.mcap";
    const std::string unpack = std::string("gzip -dc '") + ABBE_GOLDEN_RECORDINGS +
                               "/counter_card-restart.mcap.gz' >'" + whole.string() + "'";
    EXPECT_EQ(std::system(unpack.c_str()), 0);
    const auto card = std::move(*RecordingReader::open(whole));
    auto options = example_options(folder_.path());
    options.max_file_bytes = 1;
    auto recorder = std::move(*Recorder::open(options, card.info(), {}));
    int messages = 0;

    const auto count = [&] {
      if (++messages % kMessagesPerFile == 0) recorder.flush();
    };

    RecordingSink sink;
    sink.axis_sample = [&](const protocol::AxisSample& s, std::string_view device) {
      recorder.record(s, device);
      count();
    };

    sink.raw_block = [&](const protocol::RawBlock& block, std::string_view device) {
      recorder.record(protocol::to_raw_bytes(block, device));
      count();
    };

    EXPECT_EQ(card.read(sink), 0u);
    EXPECT_TRUE(recorder.close());
  }
  std::vector<protocol::AxisSample> samples(const RecordingReader& reader, ReplaySource source) {
    const auto config = parse_config(reader.info().configuration, "recorded");
    EXPECT_TRUE(config);
    std::vector<protocol::AxisSample> all;
    ReplayOptions options{.source = source};
    options.samples = [&](const Batch& batch, HostTime) {
      all.insert(all.end(), batch.axes.begin(), batch.axes.end());
    };
    EXPECT_TRUE(replay(reader, *config, options));
    return all;
  }
  std::filesystem::path path(std::uint32_t number) {
    return folder_.path() / ("run-" + std::to_string(number) + ".mcap");
  }
  bool exists(std::uint32_t number) { return std::filesystem::exists(path(number)); }
  RecordingReader file(std::uint32_t number) {
    return std::move(*RecordingReader::open(path(number)));
  }
  static HostTime time_of(const protocol::AxisSample& sample) { return sample.head.time; }

  TemporaryFolder folder_;
};

// A card is read far more often than it is recorded, and every file restarts the decimation: the
// samples of a replay may lie between those of the live run.
TEST_F(CutRecording, RawBytesOfEveryFileGiveTheAxesOfTheLiveRun) {
  constexpr double kBetween_m = 1e-3;  // 50 ms at some 20 mm/s
  std::set<std::uint8_t> begun_with;
  std::size_t compared = 0;

  for (std::uint32_t n = 2; exists(n); ++n) {
    const auto reader = file(n);
    if (reader.attachments().empty()) continue;  // no data of the card yet
    begun_with.insert(zero_state_from_attachment(reader.attachments().front())->unknown);
    const auto live = samples(reader, ReplaySource::Samples);
    for (const auto& again : samples(reader, ReplaySource::RawBytes)) {
      const auto after = std::ranges::lower_bound(live, again.head.time, {}, time_of);
      if (after == live.begin() || after == live.end()) continue;
      const auto& before = *std::prev(after);
      if (before.missing_mask != after->missing_mask) continue;
      EXPECT_EQ(again.missing_mask, after->missing_mask) << "file " << n;
      EXPECT_NEAR(again.position[0], 0.5 * (before.position[0] + after->position[0]), kBetween_m);
      ++compared;
    }
  }

  EXPECT_THAT(begun_with, ElementsAre(0b000, 0b111))
      << "files from before and after the card began anew";
  EXPECT_GT(compared, 50u);
}

/// Whether the axes are missing in a sample at `t` after the file began.
std::uint8_t missing_after(const ZeroState& state, const std::vector<FoundZero>& found,
                           bool restarted) {
  const auto config = parse_config(kTrackerMill, "abbed.toml");
  EXPECT_TRUE(config);
  AxisZeros zero{*config};
  zero.go_on(state);
  for (const auto& f : found) zero.found(f);
  Batch batch;
  auto& sample = batch.axes.emplace_back();
  sample.head.time = state.at + 1s;
  sample.axis_count = 3;
  if (restarted) sample.head.flags |= protocol::SampleFlag::Restarted;
  zero.apply(batch);
  return batch.axes[0].missing_mask;
}

TEST(ZeroState, AnUnreferencedAxisStaysUnreferencedInTheNextFile) {
  EXPECT_EQ(missing_after({HostTime{10s}, 0b010}, {}, false), 0b010);
  EXPECT_EQ(missing_after({HostTime{10s}, 0b000}, {}, false), 0b000);
}

TEST(ZeroState, NoSetUpIsTheFirstInAFurtherFile) {
  EXPECT_EQ(missing_after({HostTime{10s}, 0b000}, {}, true), 0b111);
}

TEST(ZeroState, AZeroFoundLaterIsApplied) {
  EXPECT_EQ(missing_after({HostTime{10s}, 0b110}, {{.axis = 1, .from = HostTime{10s}}}, false),
            0b100);
}

}  // namespace
}  // namespace abbe::daemon
