#pragma once
/// A measuring machine with known geometric errors, and the spheres, block faces and the bar on its
/// table:
/// computes the scale reading of a touch. The tip contacts the true surface; the machine reports
/// its scale readings at contact. SI, machine coordinates. Pure functions over plain options; safe
/// to call from any thread.

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "abbe/sim/mfb/clamped_bar.hpp"
#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim {

struct Sphere {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  double radius_m = 12.5e-3;
};

/// A square surface that can be touched from both sides.
struct Face {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double half_size_m = 10e-3;
};

struct MeasuringMachine {
  TruthMachine truth;
  std::vector<Sphere> spheres;
  std::vector<Face> faces;
  std::optional<mfb::ClampedBar> bar;
  double tip_radius_m = 2e-3;
  double approach_m = 2e-3;  ///< probing begins this far before the nominal point
  double search_m = 5e-3;    ///< probing ends this far beyond the nominal point
  double noise_m = 0.0;      ///< standard deviation of a reading along the approach
  std::uint64_t seed = 1;
};

enum class ProbingFault { AlreadyTouching, NothingThere };
struct Probing {
  std::optional<ProbingFault> fault;
  /// scale readings at contact: the centre of the tip, not the contact point
  Eigen::Vector3d reading_m = Eigen::Vector3d::Zero();
};

/// One touch: moves from place_m + approach_m x normal in the direction -normal (`normal` is a unit
/// vector). `number`: index of the random numbers for the noise of this touch (noise.hpp).
[[nodiscard]] Probing probe(const MeasuringMachine& machine, const Eigen::Vector3d& place_m,
                            const Eigen::Vector3d& normal, std::uint64_t number);

}  // namespace abbe::sim
