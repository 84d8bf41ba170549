#pragma once
/// A position or direction in JSON: [x, y, z].

#include <array>
#include <nlohmann/json.hpp>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::daemon {

/// Throws nlohmann::json exceptions if `list` is not an array of three numbers.
[[nodiscard]] inline calib::Vector3 vector_of(const nlohmann::json& list) {
  const auto v = list.get<std::array<double, 3>>();
  return {v[0], v[1], v[2]};
}

}  // namespace abbe::daemon
