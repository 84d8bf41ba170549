#pragma once
/// What a laser tracker sees of the virtual machine: pose, beam, noise in range and angles, a clock
/// of its own, and how its controller gathers points into bursts. Pure functions of (options, time,
/// index); safe to call from any thread.
///
///   p_machine = R p_tracker + P,  R = Rz Ry Rx;  p_tracker = r (cos el cos az, cos el sin az, sin el)
///   noise: r: sigma_r; el: sigma_a; az: sigma_a / cos el, so that it is sigma_a r in both directions across
///   the beam.

#include <Eigen/Core>
#include <chrono>
#include <cstdint>

#include "abbe/protocol/time.hpp"
#include "abbe/sim/virtual_machine.hpp"

namespace abbe::sim {

using protocol::DeviceTime;

struct TrackerModel {
  Eigen::Vector3d position_m{-0.75, -0.62, -0.35};     ///< P, machine coordinates
  Eigen::Vector3d rotation_rad{0.0013, -0.0342, 1.1};  ///< about x, y, z
  double sigma_range_m = 2e-6;
  double sigma_angle_rad = 3e-6;
  double max_radial_speed_m_per_s = 4.0;  ///< SpeedExceeded above, SpeedWarning above 80 %
  double max_lateral_speed_m_per_s = 4.0;
  double clock_offset_s = 12345.0;  ///< reading of its clock when it is switched on
  double clock_drift_ppm = 15.0;    ///< how much too fast its clock runs
  std::uint64_t seed = 1;
};

enum class BeamSpeed { Fine, Warning, Exceeded };

struct TrackerView {
  Eigen::Vector3d p_tracker_m = Eigen::Vector3d::Zero();
  BeamSpeed speed = BeamSpeed::Fine;
};

[[nodiscard]] Eigen::Matrix3d R_machine_tracker(const TrackerModel& model);

/// The target at `at`, as the tracker measures it; `index` numbers its noise.
[[nodiscard]] TrackerView observe(const TrackerModel& model, const VirtualMachine& machine,
                                  HostTime at, std::uint64_t index);

/// The tracker's clock at a host time, and back. `power_on` is when it read clock_offset_s.
[[nodiscard]] DeviceTime device_time(const TrackerModel& model, HostTime power_on, HostTime at);
[[nodiscard]] HostTime host_time(const TrackerModel& model, HostTime power_on, DeviceTime at);

/// Time from one burst to the next, as measured at real controllers: median 332 ms, 5 to 95 %: 324
/// to 344 ms, whatever the point rate and whatever packet rate was asked.
[[nodiscard]] std::chrono::nanoseconds burst_interval(std::uint64_t seed, std::uint64_t burst);

}  // namespace abbe::sim
