#pragma once
/// A random machine, a ball array touched on it, and typical faults of a shop floor; then the
/// verdict of the gate, and the error of the model against the truth. Deterministic from the seed.

#include <Eigen/Geometry>
#include <functional>
#include <random>
#include <vector>

#include "abbe/calib/evemu/judge/judge.hpp"
#include "abbe/sim/ball_array.hpp"
#include "abbe/sim/truth_machine.hpp"
#include "campaign.hpp"

namespace abbe::tests::never_worse {

using calib::Vector3;

/// The time of a touch: its position, and the fractions (0 to 1) of the touches of this position
/// and of the whole session that were made before.
struct TouchTime {
  int position = 1;
  double in_position = 0.0, in_session = 0.0;
};

/// The true machine and array, and what the configuration states about them; a fault changes the
/// truth or the configuration.
struct EvemuRun {
  // the truth
  sim::TruthMachine truth;
  sim::BallArray array;                            ///< the true array, in its own frame
  std::vector<Eigen::Isometry3d> T_machine_array;  ///< of positions 1, 2, ...
  std::vector<int> order;                          ///< in which the positions are touched
  std::size_t points_per_ball = 13, points_per_face = 9;
  double sigma_touch_m = 1e-6;
  /// standard deviation of a random shift common to successive touches, whose correlation time is a
  /// quarter of the time of a position
  double slow_noise_m = 0.0;
  /// Motion of the array in addition to T_machine_array, about Ball1 of the position; may be empty.
  std::function<Eigen::Isometry3d(const TouchTime&)> moved;
  /// Displacement of a point of the array, in its own frame; may be empty.
  std::function<Vector3(const TouchTime&, const Vector3& place_m)> bent;
  /// Error of the machine at a scale reading that no error motion of `truth` contains; may be
  /// empty.
  std::function<Vector3(const Vector3& q_m)> more_error_m;
  /// Error of the machine in addition to the constant V, in machine coordinates; may be empty.
  std::function<Vector3(const TouchTime&, const Vector3& q_m)> drift;
  /// Changes the list of touches; may be empty.
  std::function<void(std::vector<calib::evemu::Touch>&)> spoil;
  Vector3 stated_tool_offset_m = Vector3::Zero();  ///< from the true tip to the stated one
  // the configuration
  calib::evemu::Calibrator calibrator;
  calib::evemu::Machine machine;
  calib::evemu::ObserveOptions observe;
  calib::evemu::JudgeOptions judge;
  std::mt19937_64 random;
};

[[nodiscard]] std::vector<Fault<EvemuRun>> evemu_faults();
[[nodiscard]] EvemuRun random_evemu_run(std::uint64_t seed);
[[nodiscard]] std::vector<calib::evemu::Touch> touches_of(EvemuRun& run);
[[nodiscard]] Outcome identify_and_compare_evemu(EvemuRun run);

}  // namespace abbe::tests::never_worse
