#pragma once
/// What differs from the plan when a machine probes a Multi-Feature Bar: probe, noise, clamping,
/// temperature and mistakes. Machine axes, m.

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "abbe/sim/mfb/plan.hpp"
#include "abbe/sim/mfb/true_bar.hpp"

namespace abbe::sim::mfb {

/// The trigger comes `delay_s` times the feed behind the contact (constant pre-travel), plus
/// lobing_m cos(3 phi) sin(theta) for the approach direction (theta from Z, phi about Z).
struct Probe {
  double tip_radius_m = 1.5e-3;
  double noise_m = 0.125e-6;  ///< of a touch, along the normal; standard deviation
  double lobing_m = 0.5e-6;
  double delay_s = 1e-3;
  double feed_m_per_s = 4e-3;
  double feed_scatter = 0.002;  ///< relative standard deviation from touch to touch
};

/// Temperature of the bar during the passes. Every position has its own stated temperature, the
/// true one differs by `u_K`; the true expansion differs from the stated one by `u_alpha_per_K`.
struct BarTemperature {
  double stated_C = 20.0;
  double spread_K = 0.0;  ///< standard deviation of the stated temperatures
  double u_K = 0.0;
  double alpha_per_K = 0.0;  ///< 0, and u_alpha 0: the bar does not grow
  double u_alpha_per_K = 0.0;
};

/// How the bar lies instead of as planned: turned by 180 degrees about an axis through its middle.
enum class Turned : std::uint8_t { AboutX, AboutY, AboutZ };

struct ProbingOptions {
  std::uint64_t seed = 1;
  Probe probe;
  double machine_noise_m = 0.25e-6;  ///< repeatability of each axis; standard deviation
  double clamping_m = 0.1e-3;        ///< scatter of the pose, per coordinate and clamping
  double clamping_rad = 0.3e-3;
  /// The clamping bends the bar: each hole, per coordinate and pass; 0 at the ends, in x at hole 1.
  double shape_scatter_m = 0.0;
  /// The clamped bar moves by this much along each machine axis during a pass, evenly, with random
  /// signs. It continues on the way back.
  double drift_m = 0.0;
  BarTemperature temperature;
  std::optional<Sag> sag;
  Eigen::Vector3d gravity = -Eigen::Vector3d::UnitZ();  ///< direction in machine axes

  std::map<std::string, Turned> turned;   ///< by name of measurement or position
  std::map<std::string, double> wrong_m;  ///< by touch ("X1,hole,3,,2"): off along the normal
  std::set<std::string> missed;           ///< by touch
};

}  // namespace abbe::sim::mfb
