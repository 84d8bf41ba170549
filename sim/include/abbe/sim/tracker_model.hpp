#pragma once
/// The measurements of a laser tracker at the virtual machine: pose, beam, noise of range and
/// angles, the tracker's own clock, and how its controller groups points into bursts. Pure
/// functions of (options, time, index); safe to call from any thread.
///
///   p_machine = R p_tracker + P,  R = Rz Ry Rx
///   p_tracker = r (cos el cos az, cos el sin az, sin el)
///
/// P is the position of the tracker, R its rotation; r, az, el are range, azimuth and elevation of
/// the target. Standard deviations of the noise: sigma_r of r, sigma_a of el, sigma_a / cos el of
/// az. Across the beam the noise is therefore sigma_a r in both directions. Drift of the tracker is
/// added to p_tracker of every target; it depends on the time since the start of the motion.

#include <Eigen/Core>
#include <chrono>
#include <cstdint>

#include "abbe/protocol/time.hpp"
#include "abbe/sim/device_clock.hpp"
#include "abbe/sim/reference_nests.hpp"
#include "abbe/sim/tracker_drift.hpp"
#include "abbe/sim/virtual_machine.hpp"

namespace abbe::sim {

struct TrackerModel {
  Eigen::Vector3d position_m{-0.75, -0.62, -0.35};     ///< P, machine coordinates
  Eigen::Vector3d rotation_rad{0.0013, -0.0342, 1.1};  ///< about x, y, z
  double sigma_range_m = 2e-6;
  double sigma_angle_rad = 3e-6;
  /// status SpeedExceeded above this speed, SpeedWarning above 80 % of it
  double max_radial_speed_m_per_s = 4.0;
  double max_lateral_speed_m_per_s = 4.0;
  double clock_offset_s = 12345.0;  ///< reading of the tracker's clock at power-on
  double clock_drift_ppm = 15.0;    ///< rate error of the tracker's clock; positive: too fast
  TrackerDrift drift{};
  NestVisits nests{};  ///< the nests that the beam visits while the machine waits
  std::uint64_t seed = 1;
};

enum class BeamSpeed { Allowed, Warning, Exceeded };

struct TrackerView {
  bool has_target = true;  ///< false: the beam moves, and nothing is measured
  Eigen::Vector3d p_tracker_m = Eigen::Vector3d::Zero();
  BeamSpeed speed = BeamSpeed::Allowed;
};

[[nodiscard]] Eigen::Matrix3d R_machine_tracker(const TrackerModel& model);

/// An interval of the times at which points are measured, not of the times at which they are sent.
struct MeasuringTime {
  HostTime from = HostTime::max();
  HostTime until = HostTime::max();
  [[nodiscard]] bool holds(HostTime t) const { return t >= from && t < until; }
};

/// The measured position of the target at time `at`, that of the machine or of a nest; `index`
/// selects the random numbers of the noise.
[[nodiscard]] TrackerView observe(const TrackerModel& model, const VirtualMachine& machine,
                                  HostTime at, std::uint64_t index);

[[nodiscard]] inline DeviceClock clock_of(const TrackerModel& model) {
  return {model.clock_offset_s, model.clock_drift_ppm};
}
/// Conversion of host time to the tracker's clock and back. At `power_on` the tracker's clock reads
/// clock_offset_s.
[[nodiscard]] DeviceTime device_time(const TrackerModel& model, HostTime power_on, HostTime at);
[[nodiscard]] HostTime host_time(const TrackerModel& model, HostTime power_on, DeviceTime at);

/// Time from one burst to the next, distributed as measured at real controllers: median 332 ms, 5 %
/// and 95 % quantiles 324 and 344 ms. It depends neither on the point rate nor on the requested
/// packet rate.
[[nodiscard]] std::chrono::nanoseconds burst_interval(std::uint64_t seed, std::uint64_t burst);

}  // namespace abbe::sim
