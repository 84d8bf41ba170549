#pragma once
/// The differences from the plan when a machine probes a Multi-Feature Bar: probe, noise, clamping,
/// temperature and mistakes. Machine axes, m.

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "abbe/sim/mfb/plan.hpp"
#include "abbe/sim/mfb/true_bar.hpp"

namespace abbe::sim::mfb {

/// The trigger occurs beyond the contact by `delay_s` times the feed (constant pre-travel), plus
/// lobing_m cos(3 phi) sin(theta) for the approach direction (theta from Z, phi about Z).
struct Probe {
  double tip_radius_m = 1.5e-3;
  double noise_m = 0.125e-6;  ///< standard deviation of a touch, along the normal
  double lobing_m = 0.5e-6;
  double delay_s = 1e-3;
  double feed_m_per_s = 4e-3;
  double feed_scatter = 0.002;  ///< relative standard deviation from touch to touch
};

/// Temperature of the bar during the passes. Every position has its own stated temperature; the
/// true temperature differs from it by `u_K`. The true expansion differs from the stated one by
/// `u_alpha_per_K`.
struct BarTemperature {
  double stated_C = 20.0;
  double spread_K = 0.0;  ///< standard deviation of the stated temperatures
  double u_K = 0.0;
  double alpha_per_K = 0.0;  ///< 0 together with u_alpha 0: the bar does not expand
  double u_alpha_per_K = 0.0;
};

/// The bar is clamped turned by 180 degrees about an axis through its middle.
enum class Turned : std::uint8_t { AboutX, AboutY, AboutZ };

struct ProbingOptions {
  std::uint64_t seed = 1;
  Probe probe;
  double machine_noise_m = 0.25e-6;  ///< repeatability of each axis, as a standard deviation
  double clamping_m = 0.1e-3;        ///< scatter of the pose, per coordinate and clamping
  double clamping_rad = 0.3e-3;
  /// Standard deviation of the displacement of each hole, per coordinate and pass, because the
  /// clamping bends the bar. The displacement is 0 at the ends, and in x at hole 1.
  double shape_scatter_m = 0.0;
  /// During a pass, the clamped bar moves by this amount along each machine axis, at constant speed
  /// and with random signs. The motion continues in the backward pass.
  double drift_m = 0.0;
  BarTemperature temperature;
  std::optional<Sag> sag;
  Eigen::Vector3d gravity = -Eigen::Vector3d::UnitZ();  ///< direction in machine axes

  std::map<std::string, Turned> turned;  ///< by name of a measurement or position
  /// displacement along the normal, by touch ("X1,hole,3,,2")
  std::map<std::string, double> wrong_m;
  std::set<std::string> missed;  ///< names of touches
};

}  // namespace abbe::sim::mfb
