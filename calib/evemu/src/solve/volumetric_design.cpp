#include "abbe/calib/internal/evemu/solve/volumetric_design.hpp"

#include <utility>
#include <vector>

namespace abbe::calib::evemu {

VolumetricDesign::VolumetricDesign(std::size_t columns,
                                   std::function<Eigen::Matrix3Xd(const Vector3&)> of_reading)
    : unknowns(columns), B(std::move(of_reading)) {}

VolumetricDesign::VolumetricDesign(const ScaledDesign& design)
    : VolumetricDesign(design_of(ModelBasis(PolynomialBasis(design)), Vector3::Zero())) {}

VolumetricDesign design_of(const ModelBasis& basis, const Vector3& tool_offset_m) {
  return {basis.size(), [basis, tool_offset_m](const Vector3& reading_m) {
            std::vector<Column> memory(basis.most_columns());
            ModelColumns columns(memory);
            basis.columns({.q_m = reading_m, .tool_offset_m = tool_offset_m}, columns);

            Eigen::Matrix3Xd B = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(basis.size()));
            for (const Column& c : columns.span()) {
              B.col(static_cast<Eigen::Index>(c.parameter)) += c.dV_dU;
            }
            return B;
          }};
}

}  // namespace abbe::calib::evemu
