/// A replay uses the values of sensors that the live run used, also from a further file.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include "abbe/pipeline/pipeline.hpp"
#include "abbe/pipeline/recording_rules.hpp"
#include "abbe/replay/replay.hpp"
#include "config_tables.hpp"
#include "recording_fixture.hpp"
#include "warm_scales.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::EnvironmentSample;
using protocol::HostTime;
using Temperatures = std::map<HostTime, double>;  // of the scale, by tracker point

/// scale_x and, on a second device, its twin beside.
const std::string kRecordedConfig = to_toml(config_tables::half_metre_mill()) + test::kWarmScales +
                                    R"([[environment]]
name = "rtd2"
map = "icpdas-zt2005-c8"
serial = "/dev/serial/by-id/rs485-2"
inputs = ["beside"]
[[sensors.limit]]
name = "scale_x"
twin = "beside"
max_twin_difference_K = 5
[tracker]
host = "10.0.0.7"
)";

Config recorded() {
  const auto config = parse_config(kRecordedConfig, "abbed.toml");
  EXPECT_TRUE(config) << config.error().details.front();
  return config ? *config : Config{};
}

/// The sensor warms up, jumps for 40 s, is right again and 0.4 K higher. It jumps for good, and is
/// accepted after second 98, shortly before a new file begins.
constexpr int kAccepted = 98;
double reading_K(int second) {
  const double C = 21.0 + 0.002 * second;
  if (second >= 30 && second < 70) return 24.5 + 273.15;
  if (second >= 95) return C + 4.0 + 273.15;
  return (second >= 80 ? C + 0.4 : C) + 273.15;
}

EnvironmentSample temperature_sample(HostTime at, std::size_t channel, double temperature_K) {
  EnvironmentSample e;
  e.head.time = at;
  e.measured = protocol::temperature_bit(channel);
  e.temperature_K[channel] = temperature_K;
  return e;
}

/// What the hub hands over in second `s`: the sample of the second device arrives behind a later
/// one of the first.
Batch batch_of(int s) {
  Batch batch;
  batch.taken = HostTime{1000s} + s * 1s;
  batch.measured_environment = {
      {0, temperature_sample(batch.taken - 100ms, 0, reading_K(s))},
      {1,
       temperature_sample(batch.taken - 400ms, 1, reading_K(s) + (s >= 85 && s < 95 ? 6.0 : 0.5))}};
  for (int i = 0; i < 10; ++i) {
    protocol::AxisSample axes;
    axes.head.time = batch.taken - 1s + i * 100ms;
    axes.axis_count = 3;
    batch.axes.push_back(axes);
  }
  protocol::TrackerPoint point;
  point.head.time = batch.taken - 750ms;
  batch.points.push_back(point);
  return batch;
}

SensorAcceptance acceptance() {
  return {.sensor = "scale_x",
          .from = HostTime{1000s} + kAccepted * 1s + 900ms,
          .who = "anna",
          .why = "compared with a thermometer"};
}

class Snapshots : public PipelineObserver {
 public:
  void on_snapshots(std::span<const protocol::Snapshot> snapshots, HostTime) override {
    for (const auto& s : snapshots) seen[s.head.time] = s.environment.temperature_K[0];
  }
  Temperatures seen;
};

Temperatures live(int seconds) {
  Pipeline pipeline{assembler_options(recorded()), nullptr};
  Snapshots snapshots;
  pipeline.add(snapshots);
  for (int s = 0; s < seconds; ++s) {
    auto batch = batch_of(s);
    pipeline.cycle(batch);
    if (s == kAccepted) pipeline.accept(acceptance());
  }
  pipeline.finish({});
  return snapshots.seen;
}

/// Records `seconds`; a new file begins every `cut` seconds.
void record(const std::filesystem::path& folder, int seconds, int cut, bool with_rule = true) {
  auto options = example_options(folder);
  options.max_file_bytes = 1;
  options.sensors = sensor_check_options(recorded());
  auto info = example_info();
  info.configuration = kRecordedConfig;
  if (with_rule) std::ranges::move(recording_rules(), std::back_inserter(info.versions));
  auto recorder = std::move(*Recorder::open(options, info, {}));
  for (int s = 0; s < seconds; ++s) {
    const auto batch = batch_of(s);
    recorder.record(batch.measured_environment[0].sample, "rtd", batch.taken);
    recorder.record(batch.measured_environment[1].sample, "rtd2", batch.taken);
    for (const auto& axes : batch.axes) recorder.record(axes, "encoder", batch.taken);
    recorder.record(batch.points[0], "tracker", batch.taken);
    if (s == kAccepted) recorder.attach(to_attachment(acceptance()), acceptance().from);
    if ((s + 1) % cut == 0) recorder.flush();
  }
  ASSERT_TRUE(recorder.close());
}

Temperatures replayed(const std::filesystem::path& file) {
  const auto reader = std::move(*RecordingReader::open(file));
  Temperatures seen;
  ReplayOptions options{.source = ReplaySource::Samples};
  options.snapshots = [&](const protocol::Snapshot& s) {
    seen[s.head.time] = s.environment.temperature_K[0];
  };
  const auto report = replay(reader, recorded(), options);
  EXPECT_TRUE(report) << report.error().text;
  return seen;
}

TEST(SensorReplay, GivesTheValuesOfTheLiveRunFromEveryFile) {
  constexpr int kSeconds = 120, kCut = 25;
  const TemporaryFolder folder;
  record(folder.path(), kSeconds, kCut);
  const auto all = live(kSeconds);
  std::size_t compared = 0, held = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder.path())) {
    const auto name = file.path().filename().string();
    const auto again = replayed(file.path());
    ASSERT_FALSE(again.empty()) << name;
    for (const auto& [t, temperature_K] : again) {
      EXPECT_EQ(std::isnan(temperature_K), std::isnan(all.at(t))) << name;
      if (!std::isnan(temperature_K)) EXPECT_EQ(temperature_K, all.at(t)) << name;
      ++compared;
      held += std::abs(temperature_K - reading_K(0)) < 0.1 && t > HostTime{1032s} ? 1 : 0;
    }
  }
  EXPECT_GT(compared, 80u);
  EXPECT_GT(held, 30u) << "the jump lies in these files";
  EXPECT_GT(all.rbegin()->second, reading_K(90) + 0.1) << "it follows the accepted sensor";
}

TEST(SensorReplay, OfAnEarlierVersionUsesTheReadingsAsTheyAre) {
  const TemporaryFolder folder;
  record(folder.path(), 60, 1000, false);
  const auto again = replayed(folder.path() / "run.mcap");
  EXPECT_EQ(again.at(HostTime{1050s} - 750ms), reading_K(48));
}

}  // namespace
}  // namespace abbe::daemon
