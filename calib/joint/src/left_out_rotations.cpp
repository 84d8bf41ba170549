#include "abbe/calib/internal/joint/left_out_rotations.hpp"

#include <array>

#include "abbe/calib/estimation/datum.hpp"
#include "abbe/calib/model/model_datum.hpp"

namespace abbe::calib::joint {

LeftOutRotations::LeftOutRotations(const CommonTables& common, const Vector3& further_m)
    : common_(common) {
  if (further_m.norm() <= VolumetricModel::kToolTolerance_m) {
    return;
  }

  const ParameterLayout& layout = common.basis.layout();
  for (const Axis a : kAllAxes) {
    for (const Motion m : kAllMotions) {
      if (!is_rotation(m) || layout.find({m, a})) {
        continue;
      }
      const Vector3 about = Vector3::Unit(static_cast<Eigen::Index>(direction(m)));
      rotations_.push_back({index(a), size_, layout.node_count(a), about.cross(further_m)});
      size_ += rotations_.back().nodes;
    }
  }
}

Eigen::Matrix3Xd LeftOutRotations::B(const Vector3& reading_m) const {
  Eigen::Matrix3Xd B = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(size_));
  for (const Rotation& r : rotations_) {
    const NodeWeights w = common_.basis.interpolation(kAllAxes[r.axis])
                              .at(reading_m(static_cast<Eigen::Index>(r.axis)));
    for (std::size_t i = 0; i < w.count(); ++i) {
      B.col(static_cast<Eigen::Index>(r.offset + w.first() + i)) = w[i] * r.displacement_m;
    }
  }
  return B;
}

Result<Eigen::MatrixXd> LeftOutRotations::of_parameters() const {
  const ParameterLayout& layout = common_.basis.layout();
  const auto model = static_cast<Eigen::Index>(layout.model_size());
  Eigen::MatrixXd effect = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(layout.fit_size()),
                                                 static_cast<Eigen::Index>(size_));
  for (const Rotation& r : rotations_) {
    for (std::size_t m = 0; m < 3; ++m) {
      const auto table = layout.find({kAllMotions[m], kAllAxes[r.axis]});
      for (std::size_t i = 0; table && i < r.nodes; ++i) {
        effect(static_cast<Eigen::Index>(table->offset + i),
               static_cast<Eigen::Index>(r.offset + i)) =
            r.displacement_m(static_cast<Eigen::Index>(m));
      }
    }
  }
  if (size_ == 0) {
    return Eigen::MatrixXd(model, 0);
  }

  const estimation::Datum datum(datum_conditions(ModelDatum::G2, common_.basis, layout.fit_size()));
  const Eigen::MatrixXd free = unobservable_combinations(layout, std::array{common_.tool_offset_m});
  return datum.transformation(free).map(
      [&](const Eigen::MatrixXd& S) { return Eigen::MatrixXd((S * effect).topRows(model)); });
}

}  // namespace abbe::calib::joint
