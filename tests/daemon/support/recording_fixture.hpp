#pragma once
/// Samples whose content contains their number, and recordings of them.

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/recording/recorder.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {

using FileBytes = std::vector<char>;

inline FileBytes bytes_of_file(const std::filesystem::path& file) {
  FileBytes bytes(std::filesystem::file_size(file));
  std::ifstream(file, std::ios::binary).read(bytes.data(), std::ssize(bytes));
  return bytes;
}

inline void write_file(const std::filesystem::path& file, const FileBytes& bytes,
                       std::size_t size) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(bytes.data(), static_cast<std::streamsize>(size));
}

/// In the middle of chunk `number`, counted from 0.
inline std::size_t place_in_chunk(const FileBytes& recording, std::size_t number) {
  protocol::mcap::LinearScan scan{std::as_bytes(std::span{recording})};
  while (const auto item = scan.next())
    if (item->chunk && number-- == 0) return item->record.offset + item->record.content.size() / 2;
  ADD_FAILURE() << "too few chunks";
  return 0;
}

/// Flips one bit there.
inline void damage_chunk(const std::filesystem::path& file, std::size_t number) {
  auto bytes = bytes_of_file(file);
  const auto at = place_in_chunk(bytes, number);
  bytes[at] = static_cast<char>(bytes[at] ^ 1);
  write_file(file, bytes, bytes.size());
}

// 2026-03-01 12:00:00 UTC at host time 1000 s.
inline constexpr protocol::UtcOffset kOffset{std::chrono::seconds{1772366400 - 1000}};

inline RecordingInfo example_info() {
  return {"M1",
          kOffset,
          20.0,
          "[machine]\nname = \"M1\"\n",
          {{"abbe", "0.1.0"}, {"tracker", "emScon 3.6"}}};
}

inline RecorderOptions example_options(const std::filesystem::path& directory) {
  RecorderOptions options;
  options.directory = directory;
  options.name = "run";
  return options;
}

inline protocol::HostTime example_time(std::uint32_t i) {
  return protocol::HostTime{std::chrono::seconds{1000} + i * std::chrono::milliseconds{1}};
}

inline protocol::TrackerPoint example_point(std::uint32_t i) {
  protocol::TrackerPoint point;
  point.head = {example_time(i), std::chrono::microseconds{700 + i},
                protocol::SampleFlags{0} | protocol::SampleFlag::GapBefore, i};
  point.device_time = protocol::DeviceTime{std::chrono::microseconds{123456 + i}};
  point.p_tracker_m = {0.1 * i, -0.2 * i, 1.0 / (1 + i)};
  point.device_status = static_cast<std::int32_t>(i) - 3;
  return point;
}

inline protocol::AxisSample example_axes(std::uint32_t i) {
  protocol::AxisSample sample;
  sample.head = {example_time(i), std::chrono::nanoseconds{50}, 0, 0};
  sample.cycle = 10 * i;
  sample.axis_count = 3;
  sample.missing_mask = 4;
  sample.count = {static_cast<std::int64_t>(i) * 1000000007, -5, 1};
  sample.position = {1e-9 * i, 0.25, -1.5};
  return sample;
}

inline protocol::EnvironmentSample example_environment(std::uint32_t i) {
  protocol::EnvironmentSample sample;
  sample.head.time = example_time(i);
  sample.air_temperature_K = 293.15 + i;
  sample.air_pressure_Pa = 101325.0;
  sample.relative_humidity = 0.5;
  sample.measured |= protocol::temperature_bit(1);
  sample.temperature_K[1] = 294.0;
  return sample;
}

inline protocol::ProbeTrigger example_touch(std::uint32_t i) {
  protocol::ProbeTrigger touch;
  touch.head = {example_time(i), std::chrono::microseconds{3}, 0, i};
  touch.touch = i;
  touch.probe = 7;
  touch.latch = protocol::TouchLatch::Scan;
  touch.touch_flags = protocol::TouchFlag::Chattered | protocol::TouchFlag::SpeedTooHigh;
  touch.edge_clock_count = 1'000'000'007LL * i;
  touch.axis_count = 3;
  touch.missing_mask = 2;
  touch.speed_m_s = 0.004;
  touch.position = {0.1 * i, -0.2, 0.3};
  touch.velocity = {0.0, 0.0, -0.004};
  touch.u_position = {1e-9, 2e-9, 3e-9};
  touch.U95_position = {2e-9, 4e-9, 6e-9};

  return touch;
}

inline protocol::TouchScan example_touch_scan(std::uint32_t i) {
  protocol::TouchScan scan;
  scan.head = {example_time(i), std::chrono::nanoseconds{100}, 0, 0};
  scan.touch = 3;
  scan.axis_count = 2;
  scan.clock_count = 300'000'000'000LL + i;
  scan.latch_count = scan.clock_count - 5;
  scan.edge_count = 4;
  scan.count = {1, -2};
  scan.position = {1e-8, -2e-8};
  return scan;
}

inline protocol::RawBlock example_block(std::uint32_t i) {
  protocol::RawBlock block;
  block.time = example_time(i);
  block.lost_before = i;
  block.length = static_cast<std::uint16_t>(10 + i % 100);
  block.continued = i % 2 == 1;
  block.direction = i % 3 == 0 ? protocol::RawBlock::Direction::ToDevice
                               : protocol::RawBlock::Direction::FromDevice;
  for (std::size_t b = 0; b < block.length; ++b) block.bytes[b] = static_cast<std::byte>(i + b);
  return block;
}

inline v1::CalibrationEvent example_event(std::uint32_t i) {
  v1::CalibrationEvent event;
  event.machine("M1");
  event.host_time_ns(example_time(i).time_since_epoch().count());
  event.method("otf");
  event.state("acquiring");
  event.reason("leg " + std::to_string(i));
  event.progress(0.5);
  return event;
}

/// Sample `i`, of a kind that changes with i.
inline void record_example(Recorder& recorder, std::uint32_t i) {
  switch (i % 5) {
    case 0:
      return recorder.record(example_point(i), "tracker");
    case 1:
      return recorder.record(example_axes(i), "encoder");
    case 2:
      return recorder.record(protocol::to_raw_bytes(example_block(i), "tracker"));
    case 3:
      return recorder.record(example_environment(i), "weather");
    default:
      return recorder.record(example_event(i));
  }
}

/// Each chunk holds `per_chunk` examples; closed cleanly.
inline std::filesystem::path example_recording(const std::filesystem::path& directory,
                                               std::uint32_t chunks, std::uint32_t per_chunk) {
  auto recorder = Recorder::open(example_options(directory), example_info(), {});
  if (!recorder) {
    ADD_FAILURE() << recorder.error().text;
    return {};
  }
  for (std::uint32_t i = 0; i < chunks * per_chunk; ++i) {
    record_example(*recorder, i);
    if ((i + 1) % per_chunk == 0) recorder->flush();
  }
  const auto closed = recorder->close();
  EXPECT_TRUE(closed) << (closed ? "" : closed.error().text);
  return closed ? closed->file : std::filesystem::path{};
}

}  // namespace abbe::daemon
