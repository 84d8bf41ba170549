#include "abbe/sim/measuring_machine.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "abbe/sim/noise.hpp"

namespace abbe::sim {
namespace {

// Step of the search for the contact. It is much smaller than any sphere and tip, so that no
// contact is skipped.
constexpr double kStep_m = 50e-6;
constexpr int kHalvings = 45;  // 50 um / 2^45 is below a femtometre

/// Distance from a point to the nearest point of the square. The direction of the square's edges in
/// its plane is arbitrary: the files do not state it.
double distance_m(const Face& face, const Eigen::Vector3d& p_m) {
  const Eigen::Vector3d z = face.normal.normalized();
  const Eigen::Vector3d x = z.unitOrthogonal();
  const Eigen::Vector3d y = z.cross(x);
  const Eigen::Vector3d from = p_m - face.centre_m;
  const auto beyond = [&](double along) {
    return std::max(0.0, std::abs(along) - face.half_size_m);
  };
  return Eigen::Vector3d(beyond(from.dot(x)), beyond(from.dot(y)), from.dot(z)).norm();
}

/// Distance between the tip's surface and the nearest surface at scale reading q.
double clearance_m(const MeasuringMachine& machine, const Eigen::Vector3d& q_m) {
  const Eigen::Vector3d tip_m = position_m(machine.truth, q_m);
  double nearest = std::numeric_limits<double>::infinity();
  for (const Sphere& s : machine.spheres)
    nearest = std::min(nearest, (tip_m - s.centre_m).norm() - s.radius_m - machine.tip_radius_m);
  for (const Face& f : machine.faces)
    nearest = std::min(nearest, distance_m(f, tip_m) - machine.tip_radius_m);
  if (machine.bar)
    nearest = std::min(nearest, mfb::clearance_m(*machine.bar, tip_m, machine.tip_radius_m));
  return nearest;
}

}  // namespace

Probing probe(const MeasuringMachine& machine, const Eigen::Vector3d& place_m,
              const Eigen::Vector3d& normal, std::uint64_t number) {
  const auto at = [&](double way_m) -> Eigen::Vector3d {
    return place_m + (machine.approach_m - way_m) * normal;
  };

  if (clearance_m(machine, at(0.0)) <= 0.0) return {ProbingFault::AlreadyTouching, at(0.0)};
  const double most_m = machine.approach_m + machine.search_m;
  double free_m = 0.0;
  double touching_m = kStep_m;

  while (clearance_m(machine, at(touching_m)) > 0.0) {
    free_m = touching_m;
    touching_m += kStep_m;
    if (touching_m > most_m) return {ProbingFault::NothingThere, at(most_m)};
  }

  for (int i = 0; i < kHalvings; ++i) {
    const double middle_m = 0.5 * (free_m + touching_m);
    (clearance_m(machine, at(middle_m)) > 0.0 ? free_m : touching_m) = middle_m;
  }

  const double noise_m = machine.noise_m * gaussian(machine.seed, NoiseStream::Range, number);
  return {std::nullopt, at(touching_m) + noise_m * normal};
}

}  // namespace abbe::sim
