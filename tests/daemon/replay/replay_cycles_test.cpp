/// A replay repeats the cycles of the hub: a value that a live snapshot lacked because its stream
/// was late is missing in the replay, too, although the recording contains it.

#include <fmt/ranges.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <stdexcept>

#include "abbe/pipeline/assembler.hpp"
#include "abbe/replay/replay.hpp"
#include "config_tables.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using protocol::Snapshot;

Config tracker_and_encoders() {
  auto parsed = parse_config(to_toml(config_tables::weak_portal()) +
                                 to_toml(config_tables::Tracker{.port = 700}) +
                                 to_toml(config_tables::Encoder{}),
                             "abbed.toml");
  if (!parsed) throw std::runtime_error(fmt::format("{}", fmt::join(parsed.error().details, "\n")));
  return std::move(*parsed);
}

protocol::AxisSample replayed_axes_at(HostTime t) {
  auto sample = example_axes(0);
  sample.head.time = t;
  sample.missing_mask = 0;
  sample.position[0] = 0.1 * std::chrono::duration<double>(t.time_since_epoch()).count();
  return sample;
}

protocol::TrackerPoint replayed_point_at(HostTime t) {
  auto point = example_point(0);
  point.head = {.time = t};
  return point;
}

/// Assembles as the hub does, and records as the recorder does.
class LiveHub {
 public:
  explicit LiveHub(const std::filesystem::path& folder)
      : config_(tracker_and_encoders()),
        recorder_(*Recorder::open(example_options(folder), example_info(), {})),
        assembler_(assembler_options(config_)) {}

  void cycle(const Batch& batch) {
    for (const auto& sample : batch.axes)
      recorder_.record(sample, config_.of<EncoderConfig>()->name, batch.taken);
    for (const auto& point : batch.points)
      recorder_.record(point, config_.of<TrackerConfig>()->name, batch.taken);
    assembler_.take(batch);
    assembler_.emit(snapshots_);
  }
  [[nodiscard]] const Config& config() const { return config_; }
  [[nodiscard]] const std::vector<Snapshot>& snapshots() const { return snapshots_; }
  [[nodiscard]] RecordingReader recording() {
    return *RecordingReader::open(recorder_.close()->file);
  }

 private:
  Config config_;
  Recorder recorder_;
  Assembler assembler_;
  std::vector<Snapshot> snapshots_;
};

TEST(ReplayTurns, ASampleThatWasLateLiveIsLateInTheReplay) {
  const TemporaryFolder folder;
  LiveHub hub{folder.path()};
  const HostTime start = example_time(0);

  // Points every 10 ms; the axes keep up for a second, then come two seconds at once.
  Batch late;
  for (HostTime t = start; t < start + 4s; t += 10ms) {
    Batch batch;
    batch.taken = t + 1ms;
    batch.points = {replayed_point_at(t + 500us)};
    const bool keeps_up = t < start + 1s || t > start + 3s;
    (keeps_up ? batch : late).axes.push_back(replayed_axes_at(t));
    if (keeps_up && !late.axes.empty()) {
      batch.axes.insert(batch.axes.begin(), late.axes.begin(), late.axes.end());
      late.clear();
    }
    hub.cycle(batch);
  }

  const auto lacking = [](const std::vector<Snapshot>& snapshots) {
    return std::ranges::count_if(snapshots, [](const Snapshot& s) {
      return has(s.head.flags, protocol::SampleFlag::AxisMissing);
    });
  };

  ASSERT_GT(lacking(hub.snapshots()), 50) << "two seconds late, and 0.6 s are waited for";
  std::vector<Snapshot> again;
  const auto recording = hub.recording();
  const ReplayOptions options{.snapshots = [&](const Snapshot& s) { again.push_back(s); }};
  ASSERT_TRUE(replay(recording, hub.config(), options));
  ASSERT_GE(again.size(),
            hub.snapshots().size());  // the end of a recording gives what was still waiting

  for (std::size_t i = 0; i < hub.snapshots().size(); ++i) {
    const Snapshot& live = hub.snapshots()[i];
    EXPECT_EQ(again[i].head.time, live.head.time);
    EXPECT_EQ(again[i].head.flags, live.head.flags) << i;
    EXPECT_EQ(again[i].axis_count, live.axis_count) << i;
    EXPECT_EQ(again[i].position[0], live.position[0]) << i;
  }
}

TEST(ReplayTurns, APointDatedSecondsAheadKeepsItsPlace) {
  const TemporaryFolder folder;
  LiveHub hub{folder.path()};
  const HostTime start = example_time(0);
  std::vector<HostTime> live;

  for (int i = 0; i < 6000; ++i) {
    Batch batch;
    batch.taken = start + 20s + i * 2ms;
    // The clock of the tracker was learnt from a packet that was read ten seconds late.
    batch.points = {replayed_point_at(start + i * 2ms + (i < 100 ? 10s : 0s))};
    live.push_back(batch.points[0].head.time);
    hub.cycle(batch);
  }

  std::vector<HostTime> again;
  const auto recording = hub.recording();
  ReplayOptions options;

  options.samples = [&](const Batch& batch, HostTime) {
    for (const auto& point : batch.points) again.push_back(point.head.time);
  };

  ASSERT_TRUE(replay(recording, hub.config(), options));
  EXPECT_EQ(again, live);
}

}  // namespace
}  // namespace abbe::daemon
