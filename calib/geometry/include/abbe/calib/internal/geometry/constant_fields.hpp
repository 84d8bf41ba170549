#pragma once
/// Fields V that are constant in space, as coefficients of the scaled design.

#include <Eigen/Core>

#include "abbe/calib/geometry/scaled_design.hpp"

namespace abbe::calib {

/// Matrix (design.size() x 3) that maps a vector v [m] to the coefficients c of the scaled design
/// (scaled_design.hpp) for the field V(q) = v, which is constant in space.
inline Eigen::MatrixX3d constant_fields(const ScaledDesign& design) {
  Eigen::MatrixX3d C = Eigen::MatrixX3d::Zero(static_cast<Eigen::Index>(design.size()), 3);
  for (std::size_t j = 0; j < design.size(); ++j) {
    const DesignFunction& f = design.functions()[j];
    if (f.kind == FunctionKind::Constant) {
      C(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(f.part[0].component)) =
          1.0 / f.part[0].sign;
    }
  }
  return C;
}

}  // namespace abbe::calib
