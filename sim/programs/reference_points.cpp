#include "reference_points.hpp"

#include <fmt/format.h>

#include "abbe/sim/noise.hpp"
#include "abbe/sim/touching.hpp"

namespace abbe::sim {

std::string error_row(const TruthMachine& truth, const Eigen::Vector3d& q_m,
                      const Eigen::Vector3d& V_ball1_m, const Eigen::Vector3d& noise_m) {
  constexpr double kMmPerM = 1e3, kUmPerM = 1e6;
  const Eigen::Vector3d q_mm = kMmPerM * q_m;
  const Eigen::Vector3d V_um = kUmPerM * (error_m(truth, q_m) - V_ball1_m + noise_m);
  return fmt::format("{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", q_mm.x(), q_mm.y(),
                     q_mm.z(), V_um.x(), V_um.y(), V_um.z());
}

std::vector<Eigen::Vector3d> ball_readings_m(const TruthMachine& truth, const BallArray& array) {
  std::vector<Eigen::Vector3d> readings;
  for (const auto& T_machine_array : reference_positions()) {
    for (const ArrayBall& ball : array.balls)
      readings.push_back(reading_at_m(truth, T_machine_array * ball.centre_m));
  }
  return readings;
}

std::string reference_csv(const TruthMachine& truth, const BallArray& array, double u_m,
                          std::uint64_t seed) {
  const auto readings = ball_readings_m(truth, array);
  const Eigen::Vector3d V_ball1_m = error_m(truth, readings.front());
  std::string text = "position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const auto draw = [&](std::size_t k) {
      return u_m * gaussian(seed, NoiseStream::Range, 3 * i + k);
    };
    const std::size_t balls = array.balls.size();
    text += fmt::format("{},{},", i / balls + 1, i % balls + 1) +
            error_row(truth, readings[i], V_ball1_m, {draw(0), draw(1), draw(2)});
  }
  return text;
}

}  // namespace abbe::sim
