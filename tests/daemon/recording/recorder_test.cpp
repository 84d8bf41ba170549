#include "abbe/recording/recorder.hpp"

#include <algorithm>

#include "abbe/base/sha256.hpp"
#include "abbe/protocol/raw_bytes_cdr.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using State = RecorderStatus::State;
using WallTime = Recorder::WallTime;

class RecorderTest : public ::testing::Test {
 protected:
  Recorder open(RecorderOptions options) {
    auto recorder = Recorder::open(std::move(options), example_info(), WallTime{});
    if (!recorder) throw std::runtime_error(recorder.error().text);
    return std::move(*recorder);
  }
  Recorder open() { return open(example_options(folder_.path())); }
  RecordingReader read(std::string_view name) {
    auto reader = RecordingReader::open(folder_.path() / name);
    if (!reader) throw std::runtime_error(reader.error().text);
    return std::move(*reader);
  }
  bool exists(std::string_view name) { return std::filesystem::exists(folder_.path() / name); }

  TemporaryFolder folder_;
};

TEST_F(RecorderTest, ATrackerPointComesBackAsItWas) {
  Recorder recorder = open();
  recorder.record(example_point(7), "tracker");
  ASSERT_TRUE(recorder.close());
  std::vector<protocol::TrackerPoint> points;
  const auto reader = read("run.mcap");
  RecordingSink sink;

  sink.tracker_point = [&](const protocol::TrackerPoint& point, std::string_view device) {
    EXPECT_EQ(device, "tracker");
    points.push_back(point);
  };

  EXPECT_EQ(reader.read(sink), 0u);
  ASSERT_EQ(points.size(), 1u);
  const auto wanted = example_point(7);
  EXPECT_EQ(points[0].head.time, wanted.head.time);
  EXPECT_EQ(points[0].head.u_time, wanted.head.u_time);
  EXPECT_EQ(points[0].head.flags, wanted.head.flags);
  EXPECT_EQ(points[0].head.lost_before, wanted.head.lost_before);
  EXPECT_EQ(points[0].device_time, wanted.device_time);
  EXPECT_EQ(points[0].p_tracker_m, wanted.p_tracker_m);
  EXPECT_EQ(points[0].device_status, wanted.device_status);
}

TEST_F(RecorderTest, AnAxisSampleComesBackAsItWas) {
  Recorder recorder = open();
  recorder.record(example_axes(7), "encoder");
  ASSERT_TRUE(recorder.close());
  std::vector<protocol::AxisSample> samples;
  RecordingSink sink;

  sink.axis_sample = [&](const protocol::AxisSample& sample, std::string_view) {
    samples.push_back(sample);
  };

  EXPECT_EQ(read("run.mcap").read(sink), 0u);
  ASSERT_EQ(samples.size(), 1u);
  const auto wanted = example_axes(7);
  EXPECT_EQ(samples[0].head.time, wanted.head.time);
  EXPECT_EQ(samples[0].head.u_time, wanted.head.u_time);
  EXPECT_EQ(samples[0].cycle, wanted.cycle);
  EXPECT_EQ(samples[0].axis_count, wanted.axis_count);
  EXPECT_EQ(samples[0].missing_mask, wanted.missing_mask);
  EXPECT_EQ(samples[0].count, wanted.count);
  EXPECT_EQ(samples[0].position, wanted.position);
}

TEST_F(RecorderTest, TouchesAndTheScansAroundThemComeBackAsTheyWere) {
  Recorder recorder = open();
  recorder.record(example_touch(9), "probe");
  recorder.record(example_touch_scan(10), "probe");
  ASSERT_TRUE(recorder.close());
  std::size_t given = 0;
  RecordingSink sink;

  sink.probe_trigger = [&](const protocol::ProbeTrigger& touch, std::string_view device) {
    const auto wanted = example_touch(9);
    EXPECT_EQ(device, "probe");
    EXPECT_EQ(touch.head.time, wanted.head.time);
    EXPECT_EQ(touch.head.lost_before, wanted.head.lost_before);
    EXPECT_EQ(touch.touch, wanted.touch);
    EXPECT_EQ(touch.probe, wanted.probe);
    EXPECT_EQ(touch.latch, wanted.latch);
    EXPECT_EQ(touch.touch_flags, wanted.touch_flags);
    EXPECT_EQ(touch.edge_clock_count, wanted.edge_clock_count);
    EXPECT_EQ(touch.missing_mask, wanted.missing_mask);
    EXPECT_EQ(touch.axis_count, wanted.axis_count);
    EXPECT_EQ(touch.speed_m_s, wanted.speed_m_s);
    EXPECT_EQ(touch.position, wanted.position);
    EXPECT_EQ(touch.velocity, wanted.velocity);
    EXPECT_EQ(touch.u_position, wanted.u_position);
    EXPECT_EQ(touch.U95_position, wanted.U95_position);
    ++given;
  };

  sink.touch_scan = [&](const protocol::TouchScan& scan, std::string_view) {
    const auto wanted = example_touch_scan(10);
    EXPECT_EQ(scan.touch, wanted.touch);
    EXPECT_EQ(scan.clock_count, wanted.clock_count);
    EXPECT_EQ(scan.latch_count, wanted.latch_count);
    EXPECT_EQ(scan.edge_count, wanted.edge_count);
    EXPECT_EQ(scan.count, wanted.count);
    EXPECT_EQ(scan.position, wanted.position);
    ++given;
  };

  EXPECT_EQ(read("run.mcap").read(sink), 0u);
  EXPECT_EQ(given, 2u);
}

TEST_F(RecorderTest, RawBytesWeatherAndEventsComeBackAsTheyWere) {
  Recorder recorder = open();
  recorder.record(protocol::to_raw_bytes(example_block(3), "tracker"));
  recorder.record(example_environment(4), "weather");
  recorder.record(example_event(5));
  ASSERT_TRUE(recorder.close());
  std::size_t given = 0;
  RecordingSink sink;

  sink.raw_block = [&](const protocol::RawBlock& block, std::string_view device) {
    const auto wanted = example_block(3);
    EXPECT_EQ(device, "tracker");
    EXPECT_EQ(block.time, wanted.time);
    EXPECT_EQ(block.direction, wanted.direction);
    EXPECT_EQ(block.continued, wanted.continued);
    ASSERT_EQ(block.length, wanted.length);
    EXPECT_TRUE(std::equal(wanted.bytes.begin(), wanted.bytes.begin() + wanted.length,
                           block.bytes.begin()));
    ++given;
  };

  sink.environment = [&](const protocol::EnvironmentSample& sample, std::string_view) {
    EXPECT_EQ(sample.head.time, example_time(4));
    EXPECT_EQ(sample.air_temperature_K, example_environment(4).air_temperature_K);
    EXPECT_EQ(sample.measured, example_environment(4).measured);
    EXPECT_EQ(sample.temperature_K[1], example_environment(4).temperature_K[1]);
    EXPECT_TRUE(std::isnan(sample.temperature_K[0]));
    ++given;
  };

  sink.calibration_event = [&](const v1::CalibrationEvent& event) {
    EXPECT_TRUE(event == example_event(5));
    ++given;
  };

  EXPECT_EQ(read("run.mcap").read(sink), 0u);
  EXPECT_EQ(given, 3u);
}

TEST_F(RecorderTest, TheFileIsPartUntilClosed) {
  Recorder recorder = open();
  EXPECT_TRUE(exists("run.mcap.part"));
  EXPECT_FALSE(exists("run.mcap"));
  recorder.record(example_point(1), "tracker");
  ASSERT_TRUE(recorder.close());
  EXPECT_FALSE(exists("run.mcap.part"));
  EXPECT_TRUE(exists("run.mcap"));
  EXPECT_EQ(recorder.status().state, State::Closed);
}

TEST_F(RecorderTest, DroppedWithoutCloseItClosesCleanly) {
  { open().record(example_point(1), "tracker"); }
  EXPECT_EQ(read("run.mcap").message_count(), 1u);
}

TEST_F(RecorderTest, AnExistingRecordingIsNeverOverwritten) {
  { open().record(example_point(1), "tracker"); }
  const auto second = Recorder::open(example_options(folder_.path()), example_info(), WallTime{});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Io);
  EXPECT_NE(second.error().text.find("run.mcap: File exists"), std::string::npos)
      << second.error().text;
}

TEST_F(RecorderTest, AFolderThatCannotBeMadeIsReportedAndTriedAgain) {
  const auto nowhere = folder_.path() / "nowhere";
  write_file(nowhere, {'x'}, 1);
  auto recorder = Recorder::open(example_options(nowhere), example_info(), WallTime{100s});
  ASSERT_TRUE(recorder) << "acquisition does not wait for a disk";
  EXPECT_EQ(recorder->status().state, State::Failed);
  EXPECT_NE(recorder->status().fault.find("nowhere"), std::string::npos)
      << recorder->status().fault;
  std::filesystem::remove(nowhere);
  recorder->tick(WallTime{105s});
  EXPECT_EQ(recorder->status().state, State::Recording);
}

TEST_F(RecorderTest, AChunkIsClosedAfterItsPeriod) {
  Recorder recorder = open();
  recorder.tick(WallTime{10s});
  recorder.record(example_point(1), "tracker");
  recorder.tick(WallTime{10s + 499ms});
  EXPECT_EQ(recorder.status().chunks, 0u);
  recorder.tick(WallTime{10s + 500ms});
  EXPECT_EQ(recorder.status().chunks, 1u);
  EXPECT_EQ(recorder.status().messages, 1u);
}

TEST_F(RecorderTest, AChunkIsClosedBeforeItOutgrowsItsSize) {
  auto options = example_options(folder_.path());
  options.chunk_bytes = 4096;
  Recorder recorder = open(options);
  for (std::uint32_t i = 0; i < 500; ++i) record_example(recorder, i);
  EXPECT_GT(recorder.status().chunks, 10u);
  ASSERT_TRUE(recorder.close());
  EXPECT_EQ(read("run.mcap").message_count(), 500u);
}

TEST_F(RecorderTest, AnEmptyFileIsRemoved) {
  Recorder recorder = open();
  const auto closed = recorder.close();
  ASSERT_TRUE(closed) << closed.error().text;
  EXPECT_EQ(closed->bytes, 0u);
  EXPECT_FALSE(exists("run.mcap.part"));
  EXPECT_FALSE(exists("run.mcap"));
}

TEST_F(RecorderTest, WhatWasFlushedIsReadableWhileRecordingGoesOn) {
  Recorder recorder = open();
  recorder.record(example_point(1), "tracker");
  recorder.flush();
  recorder.record(example_point(2), "tracker");
  const auto reader = read("run.mcap.part");
  EXPECT_EQ(reader.message_count(), 1u);
  EXPECT_FALSE(reader.closed_cleanly());
  EXPECT_TRUE(reader.losses().empty());
}

TEST_F(RecorderTest, ADeviceNameBeyondTheIdlIsCountedNotWritten) {
  Recorder recorder = open();
  recorder.record(example_point(1), std::string(33, 'x'));
  recorder.record(protocol::to_raw_bytes(example_block(1), std::string(33, 'x')));
  EXPECT_EQ(recorder.status().refused, 2u);
  recorder.record(example_point(1), "tracker");
  ASSERT_TRUE(recorder.close());
  EXPECT_EQ(read("run.mcap").message_count(), 1u);
}

TEST_F(RecorderTest, TheFileExplainsItself) {
  Recorder recorder = open();
  recorder.attach({"path.csv", "text/csv", "x_mm,y_mm,z_mm\n"}, example_time(0));

  ASSERT_TRUE(recorder.close());
  const auto reader = read("run.mcap");
  EXPECT_EQ(reader.info().machine, "M1");
  EXPECT_EQ(reader.info().utc_offset.value, kOffset.value);
  EXPECT_EQ(reader.info().speed, 20.0);
  EXPECT_EQ(reader.info().configuration, example_info().configuration);
  EXPECT_EQ(reader.info().versions, example_info().versions);
  EXPECT_EQ(reader.metadata().at("abbe.configuration").at("sha256"),
            sha256_hex(example_info().configuration));
  ASSERT_EQ(reader.attachments().size(), 1u);
  EXPECT_EQ(reader.attachments()[0].name, "path.csv");
  EXPECT_EQ(reader.attachments()[0].content, "x_mm,y_mm,z_mm\n");
}

TEST_F(RecorderTest, TheDigestIsThatOfTheFile) {
  Recorder recorder = open();
  recorder.record(example_point(1), "tracker");
  recorder.flush();
  const auto so_far = recorder.digest();
  const auto prefix = bytes_of_file(so_far.file);

  EXPECT_EQ(so_far.bytes, prefix.size());
  EXPECT_EQ(so_far.sha256, sha256_hex({prefix.data(), prefix.size()}));
  recorder.record(example_point(2), "tracker");
  const auto closed = recorder.close();
  ASSERT_TRUE(closed);
  EXPECT_EQ(closed->sha256, sha256_hex_of_file(folder_.path() / "run.mcap").value_or("?"));
  EXPECT_EQ(closed->bytes, std::filesystem::file_size(folder_.path() / "run.mcap"));
  EXPECT_EQ(read("run.mcap").sha256(), closed->sha256);
}

TEST_F(RecorderTest, LateSamplesAreGivenInOrderOfTimeAndEqualOnesAsRecorded) {
  auto options = example_options(folder_.path());
  options.chunk_bytes = 2048;  // about 15 messages: a burst reaches back over several chunks
  Recorder recorder = open(options);

  for (std::uint32_t i = 0; i < 300; ++i) {
    recorder.record(example_axes(i), "encoder");
    if (i % 100 == 99) {
      for (std::uint32_t k = i - 99; k <= i; k += 2) recorder.record(example_point(k), "tracker");
    }
  }

  ASSERT_TRUE(recorder.close());
  const auto reader = read("run.mcap");
  auto cursor = reader.messages();
  protocol::HostTime before{};
  std::string_view topic_before;
  std::size_t messages = 0;

  for (; const auto message = cursor.next(); ++messages) {
    ASSERT_GE(message->taken, before);
    const bool recorded_later = message->taken == before && topic_before == "abbe/v1/TrackerPoint";
    ASSERT_FALSE(recorded_later) << "message " << messages;
    before = message->taken;
    topic_before = message->topic;
  }

  EXPECT_EQ(messages, 450u);
  EXPECT_EQ(cursor.progress(), 1.0);
  ASSERT_TRUE(reader.time_range());
  EXPECT_EQ(reader.time_range()->first, example_time(0));
  EXPECT_EQ(reader.time_range()->second, example_time(299));
}

TEST(RawBytesCdr, ByHandIsTheSameAsFastCdr) {
  for (std::uint32_t i = 0; i < 200; ++i) {
    const auto block = example_block(i);
    const std::string device(i % 33, 'd');
    v1::RawBytes message;
    message.device(device);
    message.host_time_ns(block.time.time_since_epoch().count());
    message.lost_before(block.lost_before);
    message.to_device(block.direction == protocol::RawBlock::Direction::ToDevice);
    message.continued(block.continued);
    for (std::size_t b = 0; b < block.length; ++b)
      message.bytes().push_back(static_cast<std::uint8_t>(block.bytes[b]));
    std::vector<std::byte> by_fast_cdr;
    ASSERT_TRUE(encode(message, by_fast_cdr));
    std::vector<std::byte> by_hand(protocol::kMaxRawBytesCdrSize);
    const auto size = encode_cdr(protocol::to_raw_bytes(block, device), by_hand);
    ASSERT_TRUE(size);
    by_hand.resize(*size);
    ASSERT_EQ(by_hand, by_fast_cdr) << i;
  }
}

v1::CalibrationEvent event_of(const char* state) {
  v1::CalibrationEvent event;
  event.machine("M1");
  event.method("otf");
  event.state(state);
  return event;
}

/// Small enough that every chunk is a full file.
RecorderOptions small_files(const std::filesystem::path& folder) {
  auto options = example_options(folder);
  options.max_file_bytes = 1;
  return options;
}

TEST_F(RecorderTest, AFullFileIsClosedAndTheNextContinuesWithoutAGap) {
  Recorder recorder = open(small_files(folder_.path()));
  auto point = example_point(1);
  point.head.lost_before = 0;

  for (int i = 0; i < 3; ++i) {
    recorder.record(point, "tracker");
    recorder.flush();
  }

  ASSERT_TRUE(recorder.close());
  for (const char* file : {"run.mcap", "run-2.mcap", "run-3.mcap"}) {
    int points = 0;
    RecordingSink sink;
    sink.tracker_point = [&](const protocol::TrackerPoint& p, std::string_view) {
      ++points;
      EXPECT_EQ(p.head.lost_before, 0u);
    };
    EXPECT_EQ(read(file).read(sink), 0u);
    EXPECT_EQ(points, 1) << file;
  }

  EXPECT_FALSE(exists("run-4.mcap"));
  EXPECT_FALSE(exists("run-4.mcap.part"));
  EXPECT_EQ(recorder.status().lost, 0u);
}

TEST_F(RecorderTest, TheRunOfACalibrationLiesInOneFile) {
  Recorder recorder = open(small_files(folder_.path()));
  recorder.attach({"calibration-otf.json", "application/json", "{}"}, example_time(1));
  recorder.record(event_of("warming"));

  for (std::uint32_t i = 0; i < 3; ++i) {
    recorder.record(example_point(i), "tracker");
    recorder.flush();
    EXPECT_FALSE(exists("run-2.mcap.part")) << i;
  }

  recorder.record(event_of("active"));
  recorder.flush();
  recorder.record(example_point(4), "tracker");
  ASSERT_TRUE(recorder.close());
  EXPECT_EQ(read("run.mcap").attachments().size(), 1u);
  EXPECT_EQ(read("run-2.mcap").attachments().size(), 0u)
      << "asked for again where its points are not";
}

}  // namespace
}  // namespace abbe::daemon
