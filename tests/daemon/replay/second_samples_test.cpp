/// Recordings of earlier versions: a second answer of an encoder gave a second sample of the same
/// instant, with that axis missing.

#include <gmock/gmock.h>

#include <vector>

#include "abbe/pipeline/batch.hpp"
#include "abbe/replay/replay.hpp"
#include "config_tables.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::AxisSample;
using protocol::HostTime;
using protocol::SampleFlag;

Config encoders() {
  return *parse_config(to_toml(config_tables::weak_portal()) + to_toml(config_tables::Encoder{}),
                       "abbed.toml");
}

AxisSample axes(std::uint32_t i, std::uint8_t missing_mask = 0) {
  AxisSample sample = example_axes(i);
  sample.missing_mask = missing_mask;
  if (missing_mask != 0) sample.head.flags |= SampleFlag::AxisMissing;
  return sample;
}

/// Samples 0 to 4, number 2 twice; each in a hub cycle of its own.
RecordingReader recorded(const std::filesystem::path& folder, const RecordingInfo& info) {
  auto recorder = *Recorder::open(example_options(folder), info, {});
  const std::string name = encoders().of<EncoderConfig>()->name;
  const std::vector samples{axes(0), axes(1), axes(2), axes(2, 0b010), axes(3), axes(4)};
  for (std::size_t i = 0; i < samples.size(); ++i)
    recorder.record(samples[i], name, samples[i].head.time + 100us * (i + 1));
  return *RecordingReader::open(recorder.close()->file);
}

std::vector<AxisSample> replayed(const RecordingReader& recording) {
  std::vector<AxisSample> samples;
  const auto report = replay(recording, encoders(), {.samples = [&](const Batch& batch, HostTime) {
                               samples.insert(samples.end(), batch.axes.begin(), batch.axes.end());
                             }});
  EXPECT_TRUE(report);
  return samples;
}

TEST(SecondSamples, AreCombinedWithTheFirstOneOfTheirInstant) {
  const TemporaryFolder folder;
  const auto samples = replayed(recorded(folder.path(), example_info()));
  ASSERT_EQ(samples.size(), 5u);
  for (std::uint32_t i = 0; i < 5; ++i) {
    EXPECT_EQ(samples[i].head.time, example_time(i));
    EXPECT_EQ(samples[i].missing_mask, i == 2 ? 0b010 : 0) << i;
    EXPECT_EQ(has(samples[i].head.flags, SampleFlag::AxisMissing), i == 2) << i;
  }
}

TEST(SecondSamples, AreNotSoughtInRecordingsByTheNewRule) {
  const TemporaryFolder folder;
  RecordingInfo info = example_info();
  info.versions.emplace_back(kAxisSamplesRule, "1");
  EXPECT_EQ(replayed(recorded(folder.path(), info)).size(), 6u);
}

}  // namespace
}  // namespace abbe::daemon
