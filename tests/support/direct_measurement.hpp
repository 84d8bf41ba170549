#pragma once
/// Error motions of a simulated machine as a direct device measures them: several runs forward and
/// backward at equidistant positions. Every run has an offset and, for straightness, a slope of its
/// own, because each is aligned again. Deterministic from the seed.

#include <random>
#include <string>
#include <vector>

#include "abbe/calib/direct/runs.hpp"
#include "otf_run.hpp"

namespace abbe::tests::direct {

struct DirectDevice {
  unsigned seed = 1;
  int runs = 5;
  double noise = 0.3e-6;  ///< of one value, m or rad
  double offset = 20e-6;  ///< scatter of the offset of a run, m or rad
  double slope = 30e-6;   ///< scatter of the slope of a run of a straightness
  double reversal = 0.0;  ///< forward minus backward
  double step_m = 0.05;
  bool backward = true;
};

/// Linear between the nodes; written apart from calib.
inline double table_value(const otf::MadeRun& run, calib::ErrorMotion motion, double position_m) {
  const calib::ParameterLayout layout = otf::layout_of(run.machine);
  const std::vector<double>& nodes = layout.nodes()[calib::index(motion.axis)].nodes_m;
  std::size_t cell = 0;
  while (cell + 2 < nodes.size() && position_m > nodes[cell + 1]) {
    ++cell;
  }
  const double u = (position_m - nodes[cell]) / (nodes[cell + 1] - nodes[cell]);
  const auto at = static_cast<Eigen::Index>(layout.find(motion)->offset + cell);
  return (1.0 - u) * run.truth(at) + u * run.truth(at + 1);
}

inline std::vector<double> targets_m(const calib::AxisNodes& axis, double step_m) {
  std::vector<double> targets;
  const double first = axis.nodes_m.front(), length = axis.nodes_m.back() - first;
  const int count = static_cast<int>(std::lround(length / step_m));
  for (int i = 0; i <= count; ++i) {
    targets.push_back(first + length * i / count);
  }
  return targets;
}

/// `value(position)` as the device measures it.
template <class Value>
calib::direct::MeasuredError measured_curve(const std::string& name,
                                            const std::vector<double>& targets, Value value,
                                            const DirectDevice& device) {
  std::mt19937_64 random(1000 * device.seed + 64 * static_cast<unsigned>(name[1]) +
                         static_cast<unsigned>(name[2]));
  std::normal_distribution<double> normal;
  const bool straightness = calib::is_straightness(*calib::error_motion(name));
  calib::direct::MeasuredError error{.name = name, .readings = {}};
  for (int run = 1; run <= device.runs; ++run) {
    const double offset = device.offset * normal(random);
    const double slope = straightness ? device.slope * normal(random) : 0.0;
    for (const bool forward : {true, false}) {
      for (const double p : targets) {
        const double half = (forward ? 0.5 : -0.5) * device.reversal;
        if (forward || device.backward) {
          error.readings.push_back(
              {p, value(p) + half + offset + slope * p + device.noise * normal(random), run,
               forward});
        }
      }
    }
  }
  return error;
}

inline calib::direct::MeasuredError measured_table(const otf::MadeRun& run, const std::string& name,
                                                   const DirectDevice& device = {}) {
  const calib::ErrorMotion motion = *calib::error_motion(name);
  return measured_curve(
      name, targets_m(run.machine.nodes[calib::index(motion.axis)], device.step_m),
      [&](double p) { return table_value(run, motion, p); }, device);
}

/// V of the simulated machine along the line of an axis through `at_m`: one component.
inline double V_on_line(const otf::MadeRun& run, calib::ErrorMotion translation,
                        calib::Vector3 at_m, double position_m) {
  const calib::ParameterLayout layout = otf::layout_of(run.machine);
  at_m(static_cast<Eigen::Index>(calib::index(translation.axis))) = position_m;
  const calib::Vector3 V = calib::volumetric_error(layout, {run.truth.data(), layout.model_size()},
                                                   at_m, run.machine.target_offset_m);
  return V(static_cast<Eigen::Index>(calib::direction(translation.motion)));
}

/// Slope of V_on_line() between two positions.
inline double slope_on_line(const otf::MadeRun& run, calib::ErrorMotion translation,
                            const calib::Vector3& at_m, double first_m, double last_m) {
  return (V_on_line(run, translation, at_m, last_m) - V_on_line(run, translation, at_m, first_m)) /
         (last_m - first_m);
}

/// What a device measures between the lines of X, Y, Z through `at_m` from `first_m` to `last_m`:
/// the rotation of the direction of travel, in three runs.
inline calib::direct::MeasuredError measured_squareness(const otf::MadeRun& run,
                                                        const std::string& name,
                                                        const calib::Vector3& at_m,
                                                        const calib::Vector3& first_m,
                                                        const calib::Vector3& last_m) {
  using calib::Axis, calib::Motion;
  const auto slope = [&](Motion motion, Axis axis) {
    const auto a = static_cast<Eigen::Index>(calib::index(axis));
    return slope_on_line(run, {motion, axis}, at_m, first_m(a), last_m(a));
  };
  const double value = name == "EC0Y"   ? -slope(Motion::X, Axis::Y) - slope(Motion::Y, Axis::X)
                       : name == "EB0Z" ? slope(Motion::X, Axis::Z) + slope(Motion::Z, Axis::X)
                                        : -slope(Motion::Y, Axis::Z) - slope(Motion::Z, Axis::Y);
  calib::direct::MeasuredError error{.name = name, .readings = {}, .line_m = at_m};
  for (int r = 1; r <= 3; ++r) {
    error.readings.push_back({0.0, value + 0.1e-6 * (r - 2), r, true});
  }
  return error;
}

/// All tables of the simulated machine.
inline std::vector<calib::direct::MeasuredError> all_measured(const otf::MadeRun& run,
                                                              const DirectDevice& device = {}) {
  std::vector<calib::direct::MeasuredError> errors;
  const calib::ParameterLayout layout = otf::layout_of(run.machine);
  for (const calib::Table& table : layout.tables()) {
    errors.push_back(measured_table(run, calib::name(table.motion), device));
  }
  return errors;
}

}  // namespace abbe::tests::direct
