/// A driver may read bytes late: its samples then depend on what it had sent before it read them,
/// not on the stamps. And the hub may take bytes one cycle before the samples made of them.

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <vector>

#include "abbe/devices/encoder_options.hpp"
#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/replay/replay.hpp"
#include "config_tables.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

namespace can = protocol::can;
using namespace std::chrono_literals;
using protocol::AxisSample;
using protocol::HostTime;
using protocol::RawBlock;

std::string encoders_alone() {
  return to_toml(config_tables::weak_portal()) +
         to_toml(config_tables::Encoder{.sync_period_us = 1000});
}

/// A live run without a driver: the bytes a driver would read go, in its order, into its receiver
/// and into a recording.
class LiveEncoders {
 public:
  explicit LiveEncoders(const std::filesystem::path& folder)
      : config_(*parse_config(encoders_alone(), "abbed.toml")),
        recorder_(*Recorder::open(example_options(folder), example_info(), {})),
        receiver_(device_options(*config_.of<EncoderConfig>(), config_.daemon.speed).receiver) {}

  void sync(HostTime t) { take(can::encode_sync(), t, RawBlock::Direction::ToDevice); }
  void answer(can::NodeId node, std::int64_t count, HostTime t) {
    take(can::encode_position(can::cob::tpdo(1, node), can::PositionType::Signed32, count), t,
         RawBlock::Direction::FromDevice);
  }
  void all_answer(std::int64_t count, HostTime t) {
    for (const auto& axis : config_.of<EncoderConfig>()->nodes) answer(axis.node, count, t);
  }
  /// The hub takes the bytes from now on at `bytes`, the samples made of them at `samples`.
  void cycle(HostTime bytes, HostTime samples) {
    bytes_taken_ = bytes;
    samples_taken_ = samples;
  }
  void lose_samples() { samples_are_lost_ = true; }  ///< by the recorder, all of them
  [[nodiscard]] RecordingReader recording() {
    return *RecordingReader::open(recorder_.close()->file);
  }
  [[nodiscard]] const Config& config() const { return config_; }
  [[nodiscard]] const std::vector<AxisSample>& samples() const { return samples_; }
  [[nodiscard]] const std::vector<HostTime>& turns() const { return turns_; }  ///< of samples()

 private:
  void take(const can::CanFrame& frame, HostTime t, RawBlock::Direction direction) {
    RawBlock block;
    block.time = t;
    block.direction = direction;
    can::DatagramWriter writer{block.bytes, sequence_++};
    ASSERT_TRUE(writer.add(frame));
    block.length = static_cast<std::uint16_t>(writer.finish().size());
    recorder_.record(protocol::to_raw_bytes(block, config_.of<EncoderConfig>()->name),
                     bytes_taken_);
    receiver_.on_raw(block, [this](const AxisSample& sample) {
      if (!samples_are_lost_)
        recorder_.record(sample, config_.of<EncoderConfig>()->name, samples_taken_);
      samples_.push_back(sample);
      turns_.push_back(samples_taken_.value_or(sample.head.time));
    });
  }

  Config config_;
  Recorder recorder_;
  drivers::EncoderReceiver receiver_;
  std::uint8_t sequence_ = 0;
  std::vector<AxisSample> samples_;
  std::vector<HostTime> turns_;
  Recorder::Taken bytes_taken_, samples_taken_;
  bool samples_are_lost_ = false;
};

std::vector<AxisSample> replayed(const RecordingReader& recording, const Config& config,
                                 ReplaySource source) {
  std::vector<AxisSample> samples;
  const auto report = replay(recording, config,
                             {.source = source, .samples = [&](const Batch& batch, HostTime) {
                                samples.insert(samples.end(), batch.axes.begin(), batch.axes.end());
                              }});
  EXPECT_TRUE(report.has_value());
  return samples;
}

/// NaN of an axis that never answered among them.
void expect_same(const std::vector<AxisSample>& found, const std::vector<AxisSample>& live) {
  ASSERT_EQ(found.size(), live.size());
  for (std::size_t i = 0; i < live.size(); ++i) {
    EXPECT_EQ(found[i].head.time, live[i].head.time) << i;
    EXPECT_EQ(found[i].head.flags, live[i].head.flags) << i;
    EXPECT_EQ(found[i].cycle, live[i].cycle) << i;
    EXPECT_EQ(found[i].missing_mask, live[i].missing_mask) << i;
    EXPECT_EQ(found[i].count, live[i].count) << i;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_TRUE(found[i].position[axis] == live[i].position[axis] ||
                  (std::isnan(found[i].position[axis]) && std::isnan(live[i].position[axis])));
    }
  }
}

TEST(RawReplay, DecodesBytesInTheOrderInWhichTheDriverReadThem) {
  const TemporaryFolder folder;
  LiveEncoders live{folder.path()};
  const HostTime start = example_time(0);

  for (std::int64_t i = 0; i < 6; ++i) {
    const HostTime sync = start + 1ms * i;
    live.sync(sync);
    // Each SYNC is sent before the answer is read that came just before it: as early as two clocks
    // may differ.
    if (i > 0) live.answer(3, 10 * (i - 1) + 2, sync - 10us);
    live.answer(1, 10 * i, sync + 200us);
    live.answer(2, 10 * i + 1, sync + 300us);
  }

  live.sync(start + 6ms);
  ASSERT_GE(live.samples().size(), 6u);
  const auto recording = live.recording();
  expect_same(replayed(recording, live.config(), ReplaySource::Samples), live.samples());
  expect_same(replayed(recording, live.config(), ReplaySource::RawBytes), live.samples());
}

std::vector<HostTime> cycles_from_bytes(const RecordingReader& recording, const Config& config) {
  std::vector<HostTime> turns;
  ReplayOptions options{.source = ReplaySource::RawBytes};
  options.samples = [&](const Batch& batch, HostTime) {
    turns.insert(turns.end(), batch.axes.size(), batch.taken);
  };
  EXPECT_TRUE(replay(recording, config, options));
  return turns;
}

TEST(RawReplay, GivesSamplesInTheCyclesOfTheLiveRunNotInThoseOfTheirBytes) {
  const TemporaryFolder folder;
  LiveEncoders live{folder.path()};
  const HostTime start = example_time(0);
  for (std::int64_t i = 0; i < 20; ++i) {
    const HostTime sync = start + 1ms * i;
    live.cycle(sync + 250us, i % 3 == 0 ? sync + 500us : sync + 250us);
    live.sync(sync);
    live.all_answer(i, sync + 100us);
  }
  ASSERT_GE(live.turns().size(), 19u);
  EXPECT_EQ(cycles_from_bytes(live.recording(), live.config()), live.turns());
}

TEST(RawReplay, AHeldSampleComesInTheCycleOfTheLiveRun) {
  const TemporaryFolder folder;
  LiveEncoders live{folder.path()};
  for (std::int64_t i = 0; i < 20; ++i) {
    const HostTime sync = example_time(0) + 1ms * i;
    live.cycle(sync + 250us, sync + 500us);
    live.sync(sync);
    live.all_answer(i, sync + 100us);
    live.cycle(sync + 500us, sync + 750us);
    if (i % 4 == 2) live.answer(1, i, sync + 400us);  // twice in one cycle
  }

  live.cycle(example_time(20), example_time(20));
  live.sync(example_time(20));
  const auto turns = live.turns();
  ASSERT_EQ(live.samples().back().head.time, example_time(19));
  ASSERT_EQ(turns.back(), example_time(20)) << "it was held";
  EXPECT_EQ(cycles_from_bytes(live.recording(), live.config()), turns);
}

TEST(RawReplay, ASampleHeldAtTheEndOfTheRecordingIsNotLost) {
  const TemporaryFolder folder;
  LiveEncoders live{folder.path()};
  live.lose_samples();
  for (const auto sync : {example_time(0), example_time(5)}) {  // with a pause of the SYNC
    live.cycle(sync + 250us, sync + 250us);
    live.sync(sync);
    live.all_answer(7, sync + 100us);
  }
  EXPECT_THAT(cycles_from_bytes(live.recording(), live.config()),
              testing::ElementsAre(example_time(0) + 250us, example_time(5) + 250us));
}

TEST(RawReplay, SamplesMissingInTheLiveRunComeWithTheirBytes) {
  const TemporaryFolder folder;
  LiveEncoders live{folder.path()};
  live.lose_samples();
  std::vector<HostTime> cycles_of_bytes;
  for (std::int64_t i = 0; i < 20; ++i) {
    const HostTime sync = example_time(0) + 1ms * i;
    cycles_of_bytes.push_back(sync + 250us);
    live.cycle(cycles_of_bytes.back(), cycles_of_bytes.back());
    live.sync(sync);
    live.all_answer(i, sync + 100us);
  }
  EXPECT_EQ(cycles_from_bytes(live.recording(), live.config()), cycles_of_bytes);
}

}  // namespace
}  // namespace abbe::daemon
