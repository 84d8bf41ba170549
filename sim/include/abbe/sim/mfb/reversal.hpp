#pragma once
/// The calibration of a Multi-Feature Bar by reversal on a simulated measuring machine: the bar is
/// probed repeatedly in normal orientation and turned by 180 degrees about its x axis. A step gauge
/// gives the positioning errors of the machine. Bar and gauge lie approximately along X. The faces
/// of the gauge are planes across the gauge; the tip touches a face wherever its path meets it.
/// Pure; deterministic from the seed.

#include <optional>

#include "abbe/sim/mfb/files.hpp"

namespace abbe::sim::mfb {

/// Direction in which the tip moves from face to face.
enum class GaugeTravel : std::uint8_t { AlongBar, AlongGauge, AlongX };

/// A step gauge as its certificate and its file state it, and its place.
struct StepGauge {
  std::string name = "SG-1";
  double step_m = 0.025;  ///< nominal step; the gauge is two steps longer than the bar
  double u_m = 0.15e-6;   ///< standard uncertainty of a distance: the independent part,
  /// standard uncertainty of a distance: the part proportional to the distance, common to all
  double u_per_m = 0.75e-6;
  double alpha_per_K = 11.5e-6, u_alpha_per_K = 0.2e-6;
  double temperature_C = 20.0, u_temperature_K = 0.02;
  /// y and z of the gauge's line relative to the bar's line
  Eigen::Vector3d beside_bar_m = Eigen::Vector3d::Zero();
  /// The gauge is turned relative to the bar about its first face, about the Z axis and about the
  /// bar's y axis: by these angles plus random angles with the standard deviation `alignment_rad`.
  Eigen::Vector2d turned_rad = Eigen::Vector2d::Zero();
  double alignment_rad = 0.25e-3;
  GaugeTravel travel = GaugeTravel::AlongBar;
  /// Values that the file states for the alignment and for the rotations of the machine.
  std::optional<double> u_alignment_rad;
  double u_rotation_rad = 2e-6;
  std::size_t runs = 5;
};

struct ReversalOptions {
  /// number of normal passes, and of reversed passes; each pass has its own clamping
  std::size_t repeats = 5;
  Eigen::Vector3d tool_offset_m{0.0, 0.0, -0.15};  ///< tool reference point to tip
  /// angle between X and the bar with the gauge, in the plane of X and Y
  double inclination_rad = 0.0;
  /// Inclination of the bar that the plan states. nullopt: the true inclination.
  std::optional<double> planned_inclination_rad;
  ProbingOptions probing;
  StepGauge gauge;
};

struct ReversalRun {
  /// measurements "N1", "R1", "N2", ...: normal and reversed alternately
  std::vector<Measurement> plan;
  ProbedBar probed;
  std::vector<double> distances_m;  ///< distances of the gauge's faces, from the certificate
  std::vector<std::vector<Eigen::Vector3d>> readings_m;  ///< readings by face and run
  /// position of the tip at the first face
  Eigen::Vector3d gauge_origin_m = Eigen::Vector3d::Zero();
};

/// A machine of the size of the bar with a mean error of `mean_error_m`; the travels of X, Y and Z
/// begin at 0.
[[nodiscard]] TruthMachine measuring_machine(double mean_error_m, double bar_length_m,
                                             std::uint64_t seed);

/// The passes without their touches, with the true place of the bar: in the middle of the travel of
/// Y and Z.
[[nodiscard]] std::vector<Measurement> reversal_plan(const TruthMachine& machine,
                                                     const ReversalOptions& options);

/// The same passes with the place that plan.toml states.
[[nodiscard]] std::vector<Measurement> as_planned(std::vector<Measurement> plan,
                                                  const ReversalOptions& options);

/// Distances of the faces from the first one, as the certificate states them.
[[nodiscard]] std::vector<double> gauge_distances_m(double bar_length_m, const StepGauge& gauge);
/// Centre of the tip at the first face.
[[nodiscard]] Eigen::Vector3d gauge_origin_m(const TruthMachine& machine,
                                             const ReversalOptions& options);
/// Unit vector along the gauge.
[[nodiscard]] Eigen::Vector3d gauge_direction(const ReversalOptions& options);
/// Centre of the tip at each face of the gauge at its true place, on the path of the tip.
[[nodiscard]] std::vector<Eigen::Vector3d> gauge_faces_m(const TruthMachine& machine,
                                                         double bar_length_m,
                                                         const ReversalOptions& options);

[[nodiscard]] Result<ReversalRun> run_reversal(const TruthMachine& machine, const TrueBar& bar,
                                               const ReversalOptions& options);

/// The text of gauge.toml; without readings if `run` has none.
[[nodiscard]] std::string format_gauge_toml(const ReversalRun& run, const StepGauge& gauge,
                                            const Eigen::Vector3d& tool_offset_m);

}  // namespace abbe::sim::mfb
