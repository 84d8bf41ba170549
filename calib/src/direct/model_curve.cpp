#include "direct/model_curve.hpp"

namespace abbe::calib::direct {
namespace {

/// Row of the table itself at a position.
Eigen::RowVectorXd table_row(const VolumetricModel& model, ErrorMotion motion, double position_m) {
  const estimation::TableBasis& basis = *model.tables();
  const std::size_t offset = basis.layout().find(motion)->offset;
  const estimation::NodeWeights weights = basis.interpolation(motion.axis).at(position_m);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(model.U().size());
  for (std::size_t i = 0; i < weights.count(); ++i) {
    row(static_cast<Eigen::Index>(offset + weights.first() + i)) = weights[i];
  }
  return row;
}

/// Row of one component of V at an axis position, for the tool of the model.
Eigen::RowVectorXd component_row(const VolumetricModel& model, const Vector3& q_m,
                                 std::size_t component) {
  const estimation::TableBasis& basis = *model.tables();
  std::vector<estimation::Column> memory(basis.most_columns());
  estimation::ModelColumns columns(memory);
  basis.append_columns({.q_m = q_m, .tool_offset_m = model.tool_offsets_m().front()}, columns);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(model.U().size());
  for (const estimation::Column& column : columns.span()) {
    row(static_cast<Eigen::Index>(column.parameter)) =
        column.dV_dU(static_cast<Eigen::Index>(component));
  }
  return row;
}

}  // namespace

ModelCurve::ModelCurve(const VolumetricModel& model, ErrorMotion motion,
                       const std::optional<Vector3>& line_m)
    : model_(&model), motion_(motion), line_m_(line_m) {}

const AxisNodes& ModelCurve::nodes() const {
  return model_->tables()->layout().nodes()[index(motion_.axis)];
}

bool ModelCurve::covers(double position_m) const {
  constexpr double kEnd_m = ValidityVolume::kTolerance_m;
  const std::vector<double>& nodes_m = nodes().nodes_m;
  return position_m >= nodes_m.front() - kEnd_m && position_m <= nodes_m.back() + kEnd_m;
}

Eigen::MatrixXd ModelCurve::rows(std::span<const double> positions_m) const {
  Eigen::MatrixXd A(static_cast<Eigen::Index>(positions_m.size()), model_->U().size());
  for (std::size_t i = 0; i < positions_m.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    if (!line_m_ || is_rotation(motion_.motion)) {
      A.row(row) = table_row(*model_, motion_, positions_m[i]);
      continue;
    }
    Vector3 q_m = *line_m_;
    q_m(static_cast<Eigen::Index>(index(motion_.axis))) = positions_m[i];
    A.row(row) = component_row(*model_, q_m, direction(motion_.motion));
  }
  return A;
}

Eigen::VectorXd ModelCurve::values(std::span<const double> positions_m) const {
  return rows(positions_m) * model_->U();
}

std::optional<ModelCurve> ModelCurve::of_same_axis(Motion motion) const {
  const ErrorMotion other{motion, motion_.axis};
  if (!model_->tables()->layout().find(other)) {
    return std::nullopt;
  }
  return ModelCurve(*model_, other);
}

}  // namespace abbe::calib::direct
