#pragma once
/// Collects the points of a verification ([Li OMM] section 5.4): for each standstill of the machine
/// the mean axis readings and the mean tracker position. Works with a tracker in stationary mode,
/// which delivers mean values, and with a tracker that measures continuously. Tracker points that
/// are nearer than `settle` to the beginning or end of a standstill are left out: the machine may
/// still vibrate, or the averaging time of a mean value may include motion. The result depends on
/// snapshots only, not on a clock. Not for the RT path; not thread-safe.

#include <chrono>
#include <cstddef>
#include <deque>

#include "abbe/base/error.hpp"
#include "abbe/calib/verify/observe.hpp"
#include "abbe/config/config.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct StandstillOptions {
  /// Largest change of an axis reading since the start of a standstill that still counts as
  /// standstill: noise and vibration.
  double tolerance_m = 50e-6;
  /// Time at the beginning and at the end of a standstill that is left out. Must be at least the
  /// averaging time of a tracker in stationary mode, whose default is 0.5 s.
  std::chrono::nanoseconds settle = std::chrono::milliseconds{500};
};

/// Mean values of one standstill.
struct StandstillPoint {
  calib::verify::MeasuredPoint mean;
  protocol::HostTime from{}, until{};  ///< first and last tracker point in it
  std::size_t tracker_points = 0;
  double scatter_m = 0.0;  ///< rms deviation of single tracker points from their mean
};

class StandstillPoints {
 public:
  explicit StandstillPoints(StandstillOptions options = {}) : options_(options) {}

  void take(const protocol::Snapshot& snapshot);
  /// Ends the current standstill.
  void finish();

  [[nodiscard]] const std::deque<StandstillPoint>& points() const noexcept { return points_; }
  /// Number of tracker points used so far in the current standstill.
  [[nodiscard]] std::size_t standing() const noexcept { return taken_; }

 private:
  struct Sample {
    protocol::HostTime time{};
    calib::Vector3 reading_m = calib::Vector3::Zero(), tracker_m = calib::Vector3::Zero();
  };
  void begin(const Sample& sample);
  void add(const Sample& sample);

  StandstillOptions options_;
  std::deque<StandstillPoint> points_;  // a deque: push_back() never copies earlier points
  bool running_ = false;
  Sample first_;                // first sample of the standstill; the sums are relative to it
  std::deque<Sample> pending_;  // samples nearer than `settle` to the newest one
  StandstillPoint open_;
  std::size_t taken_ = 0;
  calib::Vector3 reading_sum_m_ = calib::Vector3::Zero(), tracker_sum_m_ = calib::Vector3::Zero();
  double tracker_squares_m2_ = 0.0;
};

/// Options for the configured devices: `settle` is at least the averaging time of the tracker.
[[nodiscard]] StandstillOptions standstill_options(const Config& config);
/// Refused if readings at standstills cannot verify a model: there is no tracker, or the control
/// already corrects the axes.
[[nodiscard]] Result<void> check_verification(const Config& config);

}  // namespace abbe::daemon
