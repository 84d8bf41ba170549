// Identifies the errors of a simulated machine from tracker points on the fly, and compares the
// model with the simulated errors. All values in SI units.
#include <abbe/calib/model/model_comparison.hpp>
#include <abbe/calib/otf/identify/identify.hpp>
#include <abbe/calib/otf/plan/plan.hpp>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <random>
#include <vector>

namespace {

using abbe::calib::Vector3;
namespace otf = abbe::calib::otf;

/// Simulated errors V (true position minus scale reading): positioning and straightness of X,
/// positioning of Z.
Vector3 known_V_m(const Vector3& q_m) {
  const double x = q_m.x() / 0.3, z = q_m.z() / 0.4;
  return {8e-6 * x * x, 5e-6 * x * (1.0 - x), -6e-6 * z};
}

/// Simulates the points of a tracker at `tracker_m` while the machine drives the path; it stands
/// still at both ends.
std::vector<otf::TrackerObservation> drive(const otf::Machine& machine, const otf::Path& path,
                                           const Vector3& tracker_m, const otf::Noise& noise) {
  constexpr double kFeed_m_per_s = 0.04, kPeriod_s = 0.01, kStand_s = 2.0;
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<otf::TrackerObservation> points;

  const auto add = [&](const Vector3& reading_m) {
    const Vector3 at_m = reading_m + known_V_m(reading_m) + machine.target_offset_m - tracker_m;
    const double range_m = at_m.norm() + noise.sigma_range_m * normal(random);
    const double across_m = at_m.head<2>().norm();
    const double azimuth = std::atan2(at_m.y(), at_m.x()) + noise.sigma_angle_rad * normal(random);
    const double elevation =
        std::atan2(at_m.z(), across_m) + noise.sigma_angle_rad * normal(random);
    const Vector3 beam(std::cos(elevation) * std::cos(azimuth),
                       std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    points.push_back({kPeriod_s * static_cast<double>(points.size()), range_m * beam});
  };
  const auto stand = [&](const Vector3& at_m) {
    for (double t = 0.0; t < kStand_s; t += kPeriod_s) add(at_m);
  };

  stand(path.vertices_m.front());
  for (std::size_t i = 1; i < path.vertices_m.size(); ++i) {
    const Vector3 from_m = path.vertices_m[i - 1], leg_m = path.vertices_m[i] - from_m;
    const double duration_s = leg_m.norm() / kFeed_m_per_s;
    for (double t = 0.0; t < duration_s; t += kPeriod_s) add(from_m + t / duration_s * leg_m);
  }
  stand(path.vertices_m.back());
  return points;
}

}  // namespace

int main() {
  // Workpiece table on X, then the bed, then Y and Z with the tool.
  const auto chain = abbe::calib::KinematicChain::parse("[w X' b Y Z t]");
  const auto x = abbe::calib::equidistant_nodes(-0.3, 0.3);
  const auto y = abbe::calib::equidistant_nodes(-0.25, 0.25);
  const auto z = abbe::calib::equidistant_nodes(-0.4, 0.0);
  const otf::Machine machine{*chain, {*x, *y, *z}, {0.02, -0.015, -0.12}};
  const otf::Noise noise{.sigma_range_m = 2e-6, .sigma_angle_rad = 3e-6};
  const Vector3 tracker_m(-0.9, -0.7, -0.3);

  const otf::PlannedRun run{.machine = machine, .tracker_m = tracker_m, .noise = noise};
  const auto plan = otf::plan(run, {.length_m = 40.0}, {.lattice = 3, .exchanges = 0});
  if (!plan) {
    std::cerr << "plan: " << plan.error().text << '\n';
    return 1;
  }
  const otf::Path& path = plan->path;

  const auto points = drive(machine, path, tracker_m, noise);
  otf::Options options;
  options.segment_samples = 20;  // 8 mm of travel
  const auto found = otf::identify(points, machine, path, noise, options);
  if (!found) {
    std::cerr << "identify: " << found.error().text << '\n';
    return 1;
  }
  const abbe::calib::VolumetricModel& model = found->solution.model;

  // Two models of the same machine may differ by a rigid motion, which a tracker cannot determine.
  std::vector<Vector3> places_m, difference_m;
  double before_m = 0.0;
  for (const Vector3& q_m : abbe::calib::tensor_grid(machine.nodes)) {
    places_m.push_back(q_m);
    difference_m.push_back(known_V_m(q_m) - model.V_at(q_m, machine.target_offset_m));
    before_m = std::max(before_m, known_V_m(q_m).norm());
  }
  const auto left = abbe::calib::rigid_free(places_m, difference_m);
  if (!left) return 1;

  const auto at_centre = model.error_at({0.0, 0.0, -0.2}, machine.target_offset_m);
  std::cout << points.size() << " points; largest |V| " << 1e6 * before_m << " um\n"
            << "left with the model: " << 1e6 * left->rigid_free.rms_m << " um rms, largest "
            << 1e6 * left->rigid_free.max_m << " um\n"
            << "u(V) at the centre: " << 1e6 * std::sqrt(at_centre.cov_V_m2.trace()) << " um\n";
  return left->rigid_free.max_m < 0.1 * before_m ? 0 : 1;
}
