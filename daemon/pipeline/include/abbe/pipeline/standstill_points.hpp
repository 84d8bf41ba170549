#pragma once
/// Where the machine stood still, and where the tracker saw the reflector then: the points of a
/// verification ([Li OMM] section 5.4). For a tracker in stationary mode (one mean after the other)
/// as for one that measures continuously. What is nearer than `settle` to either end of a
/// standstill is left out: there the machine may still swing, or a mean may reach into the motion.
/// Decided from snapshots alone, never from a clock. Ordinary world; not thread-safe.

#include <chrono>
#include <cstddef>
#include <deque>

#include "abbe/base/error.hpp"
#include "abbe/calib/verify/observe.hpp"
#include "abbe/config/config.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct StandstillOptions {
  double tolerance_m = 50e-6;  ///< of an axis about where the standstill began: noise and swinging
  /// At least the averaging time of a stationary tracker, which is 0.5 s unless configured
  /// otherwise.
  std::chrono::nanoseconds settle = std::chrono::milliseconds{500};
};

/// Means over one standstill.
struct StandstillPoint {
  calib::verify::MeasuredPoint mean;
  protocol::HostTime from{}, until{};  ///< first and last tracker point in it
  std::size_t tracker_points = 0;
  double scatter_m = 0.0;  ///< of single tracker points, rms about their mean
};

class StandstillPoints {
 public:
  explicit StandstillPoints(StandstillOptions options = {}) : options_(options) {}

  void take(const protocol::Snapshot& snapshot);
  /// The standstill that still goes on ends now.
  void finish();

  [[nodiscard]] const std::deque<StandstillPoint>& points() const noexcept { return points_; }
  /// Tracker points of the present standstill that count so far.
  [[nodiscard]] std::size_t standing() const noexcept { return taken_; }

 private:
  struct Sample {
    protocol::HostTime time{};
    calib::Vector3 reading_m = calib::Vector3::Zero(), tracker_m = calib::Vector3::Zero();
  };
  void begin(const Sample& sample);
  void add(const Sample& sample);

  StandstillOptions options_;
  std::deque<StandstillPoint> points_;  // one more never copies those before
  bool running_ = false;
  Sample first_;                // of the standstill; sums are relative to it
  std::deque<Sample> pending_;  // nearer than `settle` to the newest
  StandstillPoint open_;
  std::size_t taken_ = 0;
  calib::Vector3 reading_sum_m_ = calib::Vector3::Zero(), tracker_sum_m_ = calib::Vector3::Zero();
  double tracker_squares_m2_ = 0.0;
};

/// Of this tracker.
[[nodiscard]] StandstillOptions standstill_options(const Config& config);
/// Refused where readings at standstills say nothing of a model: no tracker, or axes that the
/// control already corrects.
[[nodiscard]] Result<void> check_verification(const Config& config);

}  // namespace abbe::daemon
