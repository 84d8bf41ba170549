#pragma once
/// The errors of a simulated machine at the balls of the array, for --rotation-reference.

#include <cstdint>
#include <string>
#include <vector>

#include "abbe/sim/ball_array.hpp"
#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim {

/// Scale readings at the centres of the balls, for all positions of the array, m.
[[nodiscard]] std::vector<Eigen::Vector3d> ball_readings_m(const TruthMachine& truth,
                                                           const BallArray& array);

/// A row of errors.csv without its first columns: reading, V minus V_ball1_m, plus noise.
[[nodiscard]] std::string error_row(const TruthMachine& truth, const Eigen::Vector3d& q_m,
                                    const Eigen::Vector3d& V_ball1_m,
                                    const Eigen::Vector3d& noise_m = Eigen::Vector3d::Zero());

/// V at the balls of all positions as an independent instrument with the standard deviation `u_m`
/// measures it, in the format of errors.csv.
[[nodiscard]] std::string reference_csv(const TruthMachine& truth, const BallArray& array,
                                        double u_m, std::uint64_t seed);

}  // namespace abbe::sim
