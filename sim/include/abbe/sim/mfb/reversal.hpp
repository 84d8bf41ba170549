#pragma once
/// The calibration of a Multi-Feature Bar by reversal on a simulated measuring machine: the bar is
/// probed as it lies and turned by 180 degrees about its x axis, again and again, and a step gauge
/// gives the positioning of the machine. Bar and gauge lie along X, or nearly. The faces of the
/// gauge are planes across it; the tip touches them wherever its way leads. Pure; deterministic
/// from the seed.

#include <optional>

#include "abbe/sim/mfb/files.hpp"

namespace abbe::sim::mfb {

/// Direction in which the tip moves from face to face.
enum class GaugeTravel : std::uint8_t { AlongBar, AlongGauge, AlongX };

/// A step gauge as its certificate and its file state it, and where it lies.
struct StepGauge {
  std::string name = "SG-1";
  double step_m = 0.025;     ///< nominal; as many steps as the bar is long, and two more
  double u_m = 0.15e-6;      ///< of a distance: independent part,
  double u_per_m = 0.75e-6;  ///< and part in proportion to the distance, common to all
  double alpha_per_K = 11.5e-6, u_alpha_per_K = 0.2e-6;
  double temperature_C = 20.0, u_temperature_K = 0.02;
  Eigen::Vector3d beside_bar_m = Eigen::Vector3d::Zero();  ///< y, z of its line from the bar's line
  /// The gauge is turned from the bar about the Z axis and about the bar's y axis, about its first
  /// face: by these angles and random ones of standard deviation `alignment_rad`.
  Eigen::Vector2d turned_rad = Eigen::Vector2d::Zero();
  double alignment_rad = 0.25e-3;
  GaugeTravel travel = GaugeTravel::AlongBar;
  /// What the file states about the alignment and the rotations of the machine.
  std::optional<double> u_alignment_rad;
  double u_rotation_rad = 2e-6;
  std::size_t runs = 5;
};

struct ReversalOptions {
  std::size_t repeats = 5;  ///< normal and reversed passes, each with a clamping of its own
  Eigen::Vector3d tool_offset_m{0.0, 0.0, -0.15};  ///< tool reference point to tip
  double inclination_rad = 0.0;  ///< of bar and gauge to X, in the plane of X and Y
  /// Of the bar as the plan states it. nullopt: as it is.
  std::optional<double> planned_inclination_rad;
  ProbingOptions probing;
  StepGauge gauge;
};

struct ReversalRun {
  std::vector<Measurement> plan;  ///< "N1", "R1", "N2", ...: normal, reversed
  ProbedBar probed;
  std::vector<double> distances_m;  ///< of the gauge's faces, from the certificate
  std::vector<std::vector<Eigen::Vector3d>> readings_m;      ///< by face and run
  Eigen::Vector3d gauge_origin_m = Eigen::Vector3d::Zero();  ///< tip at the first face
};

/// A machine of the size of the bar with errors of `mean_error_m`: axes X, Y, Z from 0.
[[nodiscard]] TruthMachine measuring_machine(double mean_error_m, double bar_length_m,
                                             std::uint64_t seed);

/// The passes without their touches, with the bar as it lies: in the middle of the travel of Y and
/// Z.
[[nodiscard]] std::vector<Measurement> reversal_plan(const TruthMachine& machine,
                                                     const ReversalOptions& options);

/// The same passes as plan.toml states them.
[[nodiscard]] std::vector<Measurement> as_planned(std::vector<Measurement> plan,
                                                  const ReversalOptions& options);

/// Distances of the faces from the first one, as the certificate states them.
[[nodiscard]] std::vector<double> gauge_distances_m(double bar_length_m, const StepGauge& gauge);
/// Centre of the tip at the first face.
[[nodiscard]] Eigen::Vector3d gauge_origin_m(const TruthMachine& machine,
                                             const ReversalOptions& options);
/// Unit vector along the gauge.
[[nodiscard]] Eigen::Vector3d gauge_direction(const ReversalOptions& options);
/// Centre of the tip at each face of the gauge as it is, on the way of the tip.
[[nodiscard]] std::vector<Eigen::Vector3d> gauge_faces_m(const TruthMachine& machine,
                                                         double bar_length_m,
                                                         const ReversalOptions& options);

[[nodiscard]] Result<ReversalRun> run_reversal(const TruthMachine& machine, const TrueBar& bar,
                                               const ReversalOptions& options);

/// Without readings in `run` the text has none.
[[nodiscard]] std::string format_gauge_toml(const ReversalRun& run, const StepGauge& gauge,
                                            const Eigen::Vector3d& tool_offset_m);

}  // namespace abbe::sim::mfb
