#include "abbe/sim/tracker_model.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "abbe/sim/noise.hpp"

namespace abbe::sim {
namespace {

constexpr double kWarningShare = 0.8;

BeamSpeed judged(const TrackerModel& model, const Eigen::Vector3d& p,
                 const Eigen::Vector3d& velocity) {
  const Eigen::Vector3d beam = p.normalized();
  const double radial = std::abs(velocity.dot(beam));
  const double lateral = (velocity - velocity.dot(beam) * beam).norm();
  const double share =
      std::max(radial / model.max_radial_speed_m_per_s, lateral / model.max_lateral_speed_m_per_s);
  if (share > 1.0) return BeamSpeed::Exceeded;
  return share > kWarningShare ? BeamSpeed::Warning : BeamSpeed::Allowed;
}

Eigen::Vector3d with_noise(const TrackerModel& model, const Eigen::Vector3d& p,
                           std::uint64_t index) {
  const double across = std::hypot(p.x(), p.y());
  const double elevation0 = std::atan2(p.z(), across);
  const double range =
      p.norm() + model.sigma_range_m * gaussian(model.seed, NoiseStream::Range, index);
  const double elevation =
      elevation0 + model.sigma_angle_rad * gaussian(model.seed, NoiseStream::Elevation, index);
  const double azimuth =
      std::atan2(p.y(), p.x()) + model.sigma_angle_rad / std::cos(elevation0) *
                                     gaussian(model.seed, NoiseStream::Azimuth, index);
  return range * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                 std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
}

}  // namespace

Eigen::Matrix3d R_machine_tracker(const TrackerModel& model) {
  return (Eigen::AngleAxisd(model.rotation_rad.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(model.rotation_rad.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(model.rotation_rad.x(), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

TrackerView observe(const TrackerModel& model, const VirtualMachine& machine, HostTime at,
                    std::uint64_t index) {
  const double elapsed_s = machine.elapsed_s(at);
  const Beam beam = beam_at(model.nests, machine.path().waits_s(), elapsed_s);
  if (beam.target == BeamTarget::None) return {.has_target = false};
  const Eigen::Vector3d drift_m = model.drift.at(elapsed_s / machine.path().duration_s());
  if (beam.target == BeamTarget::Nest) {
    const Eigen::Vector3d p = nest_position_m(model.nests, beam, elapsed_s) + drift_m;
    return {.p_tracker_m = with_noise(model, p, index)};
  }

  const Eigen::Matrix3d R_tracker_machine = R_machine_tracker(model).transpose();
  const Eigen::Vector3d p = R_tracker_machine * (machine.target_m(at) - model.position_m);
  const Eigen::Vector3d velocity = R_tracker_machine * machine.motion(at).velocity_m_per_s;
  return {.p_tracker_m = with_noise(model, p + drift_m, index),
          .speed = judged(model, p, velocity)};
}

DeviceTime device_time(const TrackerModel& model, HostTime power_on, HostTime at) {
  return device_time(clock_of(model), power_on, at);
}

HostTime host_time(const TrackerModel& model, HostTime power_on, DeviceTime at) {
  return host_time(clock_of(model), power_on, at);
}

std::chrono::nanoseconds burst_interval(std::uint64_t seed, std::uint64_t burst) {
  // Two half-normal distributions about the median; 90 % are within 1.645 standard deviations.
  const double z = gaussian(seed, NoiseStream::Burst, burst);
  const double ms = 332.0 + z * (z < 0.0 ? 8.0 : 12.0) / 1.645;
  return seconds_to_ns(std::clamp(ms, 300.0, 400.0) * 1e-3);
}

}  // namespace abbe::sim
