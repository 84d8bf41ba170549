#include "abbe/sim/random_truth.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "abbe/sim/noise.hpp"

namespace abbe::sim {
namespace {

constexpr std::uint64_t kHarmonics = 4;  // at most; random numbers are reserved for them
// Typical proportions of a medium machining centre, before scaling: a rotation of 60 urad moves a
// point at 0.5 m by 30 um, the amplitude of the translations.
constexpr double kTranslation_m = 30e-6;
constexpr double kRotation_rad = 60e-6;
constexpr double kSquareness_rad = 60e-6;

std::vector<double> nodes_over(const AxisRange& range, const RandomTruthOptions& options) {
  const double first_m = range.min_m - options.beyond_m;
  const double length = range.max_m + options.beyond_m - first_m;
  const auto cells = std::max<std::size_t>(
      1, static_cast<std::size_t>(std::lround(length / options.node_spacing_m)));
  std::vector<double> nodes(cells + 1);
  for (std::size_t i = 0; i <= cells; ++i) {
    nodes[i] = first_m + length * static_cast<double>(i) / static_cast<double>(cells);
  }
  return nodes;
}

/// A sum of harmonics with decreasing amplitude and random phase: smooth, neither periodic over the
/// axis nor symmetric.
ErrorFunction smooth_random(const std::vector<double>& nodes, double amplitude,
                            std::uint64_t sequence, const RandomTruthOptions& options) {
  std::vector<double> values(nodes.size(), 0.0);
  const double length = nodes.back() - nodes.front();
  for (std::uint64_t k = 1; k <= std::min(options.harmonics, kHarmonics); ++k) {
    const std::uint64_t index = sequence * 2 * kHarmonics + 2 * k;
    const double phase = 2.0 * std::numbers::pi * uniform(options.seed, NoiseStream::Truth, index);
    const double order = static_cast<double>(k);
    const double a = amplitude / order * gaussian(options.seed, NoiseStream::Truth, index + 1);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const double u = (nodes[i] - nodes.front()) / length;
      values[i] += a * std::sin(std::numbers::pi * order * u + phase);
    }
  }

  return {nodes, std::move(values), options.shape};
}

/// f minus the line through the two values at the ends of the range.
ErrorFunction minus_line(const ErrorFunction& f, const AxisRange& range, double at_first,
                         double at_last) {
  const auto nodes = f.nodes_m();
  std::vector<double> values(f.values().begin(), f.values().end());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double u = (nodes[i] - range.min_m) / (range.max_m - range.min_m);
    values[i] -= (1.0 - u) * at_first + u * at_last;
  }
  return f.with_values(std::move(values));
}

ErrorFunction zero_at(const ErrorFunction& f, const AxisRange& range) {
  return minus_line(f, range, f.at(range.reference_m), f.at(range.reference_m));
}

/// The displacement of the target by those rotations of `axis` that data with one target cannot
/// separate from translations: all rotations of the last axis, and of the middle axis the rotation
/// about the direction of the last axis.
Eigen::Vector3d displacement_at_target(const TruthMachine& machine, Axis axis, double at_m) {
  const auto& error = machine.axis(axis).error;
  const Eigen::Vector3d rotation(error[3].at(at_m), error[4].at(at_m), error[5].at(at_m));
  if (axis == machine.order[2]) return rotation.cross(machine.target_offset_m);
  if (axis != machine.order[1]) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d last = Eigen::Vector3d::Unit(static_cast<Eigen::Index>(machine.order[2]));
  return (rotation.dot(last) * last).cross(machine.target_offset_m);
}

void remove_rigid_part(TruthMachine& machine, Axis axis) {
  AxisTruth& a = machine.axis(axis);
  for (std::size_t m = 3; m < kMotions; ++m) a.error[m] = zero_at(a.error[m], a.range);
  const Eigen::Vector3d first = displacement_at_target(machine, axis, a.range.min_m);
  const Eigen::Vector3d last = displacement_at_target(machine, axis, a.range.max_m);
  for (std::size_t m = 0; m < 3; ++m) {
    const auto k = static_cast<Eigen::Index>(m);
    ErrorFunction& f = a.error[m];
    f = m == static_cast<std::size_t>(axis)
            ? zero_at(f, a.range)
            : minus_line(f, a.range, f.at(a.range.min_m) + first[k], f.at(a.range.max_m) + last[k]);
  }
}

void scale(TruthMachine& machine, double factor) {
  for (AxisTruth& axis : machine.axes) {
    for (ErrorFunction& f : axis.error) {
      std::vector<double> values(f.values().begin(), f.values().end());
      for (double& v : values) v *= factor;
      f = f.with_values(std::move(values));
    }
  }
  machine.squareness.A0Z_rad *= factor;
  machine.squareness.B0Z_rad *= factor;
  machine.squareness.C0Y_rad *= factor;
}

void add_backlash(TruthMachine& machine, const RandomTruthOptions& options) {
  for (const Axis axis : kAxes) {
    for (std::size_t m = 0; m < kMotions; ++m) {
      const std::uint64_t index = static_cast<std::uint64_t>(axis) * kMotions + m;
      machine.axis(axis).backlash[m] =
          options.backlash_m * gaussian(options.seed, NoiseStream::Backlash, index);
    }
  }
}

}  // namespace

TruthMachine random_truth(TruthMachine machine, const RandomTruthOptions& options) {
  for (const Axis axis : kAxes) {
    AxisTruth& a = machine.axis(axis);
    const std::vector<double> nodes = nodes_over(a.range, options);
    for (std::size_t m = 0; m < kMotions; ++m) {
      const double amplitude = m < 3 ? kTranslation_m : kRotation_rad;
      a.error[m] =
          smooth_random(nodes, amplitude, static_cast<std::uint64_t>(axis) * kMotions + m, options);
    }
    a.backlash = {};
    remove_rigid_part(machine, axis);
  }

  machine.squareness.A0Z_rad = kSquareness_rad * gaussian(options.seed, NoiseStream::Squareness, 0);
  machine.squareness.B0Z_rad = kSquareness_rad * gaussian(options.seed, NoiseStream::Squareness, 1);
  machine.squareness.C0Y_rad = kSquareness_rad * gaussian(options.seed, NoiseStream::Squareness, 2);

  // V is linear in the errors except for the second order, which the second pass corrects.
  for (int pass = 0; pass < 2; ++pass) scale(machine, options.mean_error_m / mean_error_m(machine));
  add_backlash(machine, options);
  return machine;
}

double mean_error_m(const TruthMachine& truth, std::size_t n) {
  const auto at = [n](const AxisRange& r, std::size_t i) {
    return r.min_m + (r.max_m - r.min_m) * static_cast<double>(i) / static_cast<double>(n - 1);
  };

  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t k = 0; k < n; ++k) {
        const Eigen::Vector3d q(at(truth.axes[0].range, i), at(truth.axes[1].range, j),
                                at(truth.axes[2].range, k));
        sum += error_m(truth, q).norm();
      }
    }
  }

  return sum / static_cast<double>(n * n * n);
}

}  // namespace abbe::sim
