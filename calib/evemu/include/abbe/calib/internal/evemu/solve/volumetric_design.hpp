#pragma once
/// The design matrix of any form of model at a reading, as a dense matrix for one stylus. The rows
/// of a ball array need V only at touched points. They therefore have the same form for polynomials
/// and for tables, also if a model has further unknowns.

#include <Eigen/Core>
#include <cstddef>
#include <functional>

#include "abbe/calib/geometry/scaled_design.hpp"
#include "abbe/calib/internal/geometry/model_basis.hpp"

namespace abbe::calib::evemu {

/// A model that is linear in its unknowns U: V(r) = B(r) U at the reading r.
struct VolumetricDesign {
  VolumetricDesign(std::size_t columns, std::function<Eigen::Matrix3Xd(const Vector3&)> of_reading);
  /// The polynomials of a ball array. They are valid for the tool offset they were made with.
  VolumetricDesign(const ScaledDesign&);  // NOLINT(google-explicit-constructor): it is a design

  std::size_t unknowns = 0;  ///< number of columns of B
  std::function<Eigen::Matrix3Xd(const Vector3& reading_m)> B;
};
/// Makes the design of a basis for the tool offset of the stylus.
[[nodiscard]] VolumetricDesign design_of(const ModelBasis&, const Vector3& tool_offset_m);

}  // namespace abbe::calib::evemu
