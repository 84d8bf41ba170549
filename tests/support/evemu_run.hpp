#pragma once
/// The reference run of the ball array as inputs of the method: touches, calibrator, truth. SI.

#include <algorithm>
#include <iterator>
#include <map>
#include <vector>

#include "abbe/calib/evemu/observe/observe.hpp"
#include "evemu_reference.hpp"

namespace abbe::tests::evemu {

using calib::Vector3;

inline calib::evemu::Machine reference_machine() {
  return {*calib::KinematicChain::parse("[w b Z X Y t]"), Vector3::Zero()};
}

inline calib::evemu::Calibrator reference_calibrator() {
  const auto chain = reference_json("chain_noiseless.json");
  calib::evemu::Calibrator c;
  c.name = "L array";
  int number = 0;
  for (const auto& ball : chain["pre_balls"]) {
    c.balls.push_back({++number, vector3(ball) / 1000, 12.7e-3, 0.0});
  }
  number = 0;
  for (const auto& normal : chain["pre_normals"]) {
    c.blocks.push_back({++number, vector3(normal), 0.0});
  }
  return c;
}

inline std::vector<calib::evemu::Touch> reference_touches(const std::string& file) {
  std::vector<calib::evemu::Touch> touches;
  for (const auto& row : reference_cells(file)) {
    touches.push_back(
        {std::stoi(row[0]),
         row[1] == "ball" ? calib::evemu::Feature::Ball : calib::evemu::Feature::Block,
         std::stoi(row[2]),
         Vector3(std::stod(row[3]), std::stod(row[4]), std::stod(row[5])) / 1000});
  }
  return touches;
}

/// The touches in the order of [Li OMM] section 3: for every position of `positions`, in their
/// order: Ball1, the blocks, the other balls.
inline std::vector<calib::evemu::Touch> touches_in_order(
    const std::vector<calib::evemu::Touch>& all,
    const std::vector<int>& positions = {1, 2, 3, 4, 5, 6, 7, 8}) {
  using calib::evemu::Feature;
  std::vector<calib::evemu::Touch> touches;
  const auto rank = [](const calib::evemu::Touch& t) {
    return t.feature == Feature::Block ? t.number : (t.number == 1 ? 0 : 10 * t.number);
  };

  for (const int position : positions) {
    const auto first = std::ssize(touches);
    std::copy_if(all.begin(), all.end(), std::back_inserter(touches),
                 [&](const auto& t) { return t.position == position; });
    std::stable_sort(touches.begin() + first, touches.end(),
                     [&](const auto& a, const auto& b) { return rank(a) < rank(b); });
  }

  return touches;
}

/// points72.csv: errors computed from the truth, with a noise of 5 um per ball.
inline std::vector<calib::evemu::BallError> reference_errors() {
  std::vector<calib::evemu::BallError> errors;
  for (const auto& row : reference_cells("points72.csv")) {
    const auto mm = [&](std::size_t i) {
      return Vector3(std::stod(row[i]), std::stod(row[i + 1]), std::stod(row[i + 2]));
    };
    errors.push_back({std::stoi(row[0]), std::stoi(row[1]), mm(2) / 1000, mm(5) / 1000});
  }
  return errors;
}

/// Table 3 coefficients, in the order of the equivalent model's names, mm and rad.
inline Eigen::VectorXd reference_coefficients(const std::string& solution) {
  const auto all = reference_json("solutions.json");
  const auto& beta = all["solutions"][solution]["beta"];
  Eigen::VectorXd b(static_cast<Eigen::Index>(beta.size()));
  Eigen::Index i = 0;
  // nlohmann's JSON sorts names as the model does.
  for (const auto& [name, value] : beta.items()) {
    b(i++) = value.template get<double>();
  }
  return b;
}

}  // namespace abbe::tests::evemu
