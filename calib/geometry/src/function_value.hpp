#pragma once
/// Value of a function of the scaled design (scaled_design.hpp).

#include "abbe/calib/geometry/scaled_design.hpp"

namespace abbe::calib {

inline Vector3 function_value(const DesignFunction& f, const ScaledDesign::Factors& at) {
  Vector3 value = Vector3::Zero();
  for (std::size_t p = 0; p < f.parts; ++p) {
    value(static_cast<Eigen::Index>(f.part[p].component)) += ScaledDesign::value(f, f.part[p], at);
  }
  return value;
}

}  // namespace abbe::calib
