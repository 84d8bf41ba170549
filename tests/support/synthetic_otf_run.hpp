#pragma once
/// A small on-the-fly run as files: a machine of 120 mm cubed with known errors (the simulator's
/// exact transforms), a random walk over a 3 x 3 x 3 lattice, and what a noise-free tracker sees of
/// it.

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/sim/path_motion.hpp"
#include "abbe/sim/truth_machine.hpp"
#include "text_files.hpp"

namespace abbe::daemon::test {

inline constexpr double kHalfTravel_m = 0.06;
inline constexpr double kPointRate_Hz = 200.0;

inline sim::TruthMachine synthetic_truth() {
  std::mt19937 random(20240517);
  std::uniform_real_distribution<double> value(-1.0, 1.0);
  sim::TruthMachine truth;
  truth.target_offset_m = {0.02, -0.015, -0.12};

  for (const auto axis : sim::kAxes) {
    truth.axis(axis).range = {-kHalfTravel_m, kHalfTravel_m, 0.0};
    for (std::size_t m = 0; m < sim::kMotions; ++m) {
      const double size = m < 3 ? 10e-6 : 30e-6;  // m, rad
      const double first = size * value(random), middle = size * value(random),
                   last = size * value(random);
      truth.axis(axis).error[m] =
          sim::ErrorFunction({-kHalfTravel_m, 0.0, kHalfTravel_m}, {first, middle, last});
    }
  }

  truth.squareness = {20e-6, -15e-6, 30e-6};
  return truth;
}

/// 60 legs between lattice points, none shorter than half the travel, none twice in a row.
inline std::vector<Eigen::Vector3d> synthetic_path_m() {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> place(-1, 1);
  std::vector<Eigen::Vector3d> path{{-kHalfTravel_m, -kHalfTravel_m, -kHalfTravel_m}};
  while (path.size() < 61) {
    const Eigen::Vector3d next =
        kHalfTravel_m * Eigen::Vector3d(place(random), place(random), place(random));
    if (next != path.back()) path.push_back(next);
  }
  return path;
}

/// The same path as a calibration request contains it.
inline std::vector<AxisPosition> synthetic_request_path_m() {
  std::vector<AxisPosition> path;
  for (const auto& q : synthetic_path_m()) path.push_back({q[0], q[1], q[2]});
  return path;
}

struct OtfFiles {
  std::filesystem::path machine, path, tracker;
};

/// Evidence of the path's orientation.
inline constexpr const char* kTrackerPlacement =
    "[tracker]\nvertical = \"+Z\"\nposition_mm = [-900, -700, -200]\n";

inline std::string synthetic_machine_toml() {
  std::string text = "[machine]\nname = \"small mill\"\nchain = \"[w b X Y Z t]\"\n";
  for (const char axis : sim::kAxisLetters)
    text += fmt::format("[axes.{}]\nmin_mm = -60\nmax_mm = 60\n", axis);
  return text + "[target]\noffset_mm = [20, -15, -120]\n[model]\nnode_spacing_mm = 60\n" +
         kTrackerPlacement;
}

inline std::string synthetic_path_csv() {
  std::string text = "x_mm,y_mm,z_mm\n";
  for (const auto& q : synthetic_path_m())
    text += fmt::format("{},{},{}\n", q[0] * 1e3, q[1] * 1e3, q[2] * 1e3);
  return text;
}

struct SyntheticPoint {
  double time_s = 0.0;
  Eigen::Vector3d q_m, p_tracker_m;
};

/// Tracker frame turned and moved against the machine. `stand_s`: after the last leg.
inline std::vector<SyntheticPoint> synthetic_points(
    double dwell_s = 0.2, double stand_s = 0.2,
    const sim::TruthMachine& truth = synthetic_truth()) {
  sim::PathPlan plan;
  for (const auto& q : synthetic_path_m()) plan.vertices.push_back({q});
  plan.dwell_s = dwell_s;  // the standstill at both ends must hold 20 points
  const auto motion = sim::PathMotion::plan(plan).value();
  const Eigen::Matrix3d R_machine_tracker =
      Eigen::AngleAxisd(1.1, Eigen::Vector3d(0.02, -0.03, 1).normalized()).matrix();
  const Eigen::Vector3d tracker_m(-0.9, -0.7, -0.3);
  std::vector<SyntheticPoint> points;
  const auto count = static_cast<int>((motion.duration_s() + stand_s) * kPointRate_Hz);

  for (int i = 0; i < count; ++i) {
    const double time_s = i / kPointRate_Hz;
    const auto state = motion.at(time_s);
    points.push_back({time_s, state.q_m,
                      R_machine_tracker.transpose() *
                          (sim::position_m(truth, state.q_m, {state.direction}) - tracker_m)});
  }

  return points;
}

/// Spherical form.
inline std::string synthetic_tracker_csv(const sim::TruthMachine& truth = synthetic_truth()) {
  std::string text = "time_s,range_mm,azimuth_rad,elevation_rad\n";
  for (const auto& [time_s, q_m, p_m] : synthetic_points(0.2, 0.2, truth))
    text += fmt::format("{},{:.17g},{:.17g},{:.17g}\n", time_s, p_m.norm() * 1e3,
                        std::atan2(p_m[1], p_m[0]), std::asin(p_m[2] / p_m.norm()));
  return text;
}

inline OtfFiles write_synthetic_run(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  OtfFiles files{folder / "machine.toml", folder / "path.csv", folder / "tracker.csv"};
  write_text(files.machine, synthetic_machine_toml());
  write_text(files.path, synthetic_path_csv());
  write_text(files.tracker, synthetic_tracker_csv());
  return files;
}

}  // namespace abbe::daemon::test
