#pragma once
/// The synthetic on-the-fly run as abbed would have recorded it.

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <optional>

#include "abbe/methods/calibration_request.hpp"
#include "abbe/recording/recorded_clock.hpp"
#include "abbe/recording/recorder.hpp"
#include "config_tables.hpp"
#include "synthetic_otf_run.hpp"

namespace abbe::daemon::test {

/// As the run was recorded: its encoders answer as often as the tracker measures.
inline std::string synthetic_recorded_toml() {
  return synthetic_machine_toml() + to_toml(config_tables::Encoder{.sync_period_us = 5000}) +
         "[daemon]\nsimulated = true\n";
}

inline std::filesystem::path record_synthetic_run(
    const std::filesystem::path& folder, std::optional<calib::otf::Mode> mode = std::nullopt,
    std::optional<ClockChange> clock = std::nullopt) {
  using protocol::HostTime;
  constexpr HostTime kBegin{std::chrono::seconds{100}};
  RecorderOptions options;
  options.directory = folder;
  options.name = "run";
  options.chunk_bytes = 16 * 1024;
  auto recorder =
      Recorder::open(options, {.machine = "mill", .configuration = synthetic_recorded_toml()}, {});
  EXPECT_TRUE(recorder) << recorder.error().text;
  OtfRequest request{.path_m = {}, .mode = mode};
  for (const auto& q : synthetic_path_m()) request.path_m.push_back({q[0], q[1], q[2]});
  recorder->attach(to_attachment(CalibrationRequest{.task = std::move(request), .from = kBegin}),
                   kBegin);

  for (const auto& point : synthetic_points(0.4, 2.0)) {
    const HostTime time = kBegin + std::chrono::duration_cast<std::chrono::nanoseconds>(
                                       std::chrono::duration<double>(point.time_s));
    protocol::AxisSample axes;
    axes.head.time = time;
    axes.axis_count = 3;
    protocol::TrackerPoint tracker;
    tracker.head.time = time;
    tracker.device_time = protocol::DeviceTime{time.time_since_epoch()};

    for (std::size_t a = 0; a < 3; ++a) {
      axes.position[a] = point.q_m[static_cast<Eigen::Index>(a)];
      tracker.p_tracker_m[a] = point.p_tracker_m[static_cast<Eigen::Index>(a)];
    }

    recorder->record(axes, "encoder");
    recorder->record(tracker, "tracker");
  }

  if (clock) recorder->attach(to_attachment(*clock), kBegin);
  const auto closed = recorder->close();
  EXPECT_TRUE(closed) << closed.error().text;
  return closed->file;
}

}  // namespace abbe::daemon::test
