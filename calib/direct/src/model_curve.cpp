#include "model_curve.hpp"

namespace abbe::calib::direct {
namespace {

/// Row that gives the value of the table at a position when multiplied by U.
Eigen::RowVectorXd table_row(const VolumetricModel& model, ErrorMotion motion, double position_m) {
  const TableBasis& basis = *model.tables();
  const std::size_t offset = basis.layout().find(motion)->offset;
  const NodeWeights weights = basis.interpolation(motion.axis).at(position_m);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(model.U().size());
  for (std::size_t i = 0; i < weights.count(); ++i) {
    row(static_cast<Eigen::Index>(offset + weights.first() + i)) = weights[i];
  }
  return row;
}

/// Row that gives one component of V at the axis positions q_m when multiplied by U.
Eigen::RowVectorXd component_row(const TableBasis& basis, const Vector3& tool_m, const Vector3& q_m,
                                 std::size_t component) {
  std::vector<Column> memory(basis.most_columns());
  ModelColumns columns(memory);
  basis.append_columns({.q_m = q_m, .tool_offset_m = tool_m}, columns);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(static_cast<Eigen::Index>(basis.size()));
  for (const Column& column : columns.span()) {
    row(static_cast<Eigen::Index>(column.parameter)) =
        column.dV_dU(static_cast<Eigen::Index>(component));
  }
  return row;
}

}  // namespace

Eigen::MatrixXd rows_along(const TableBasis& basis, const Vector3& tool_m, ErrorMotion translation,
                           const Vector3& line_m, std::span<const double> positions_m) {
  Eigen::MatrixXd A(static_cast<Eigen::Index>(positions_m.size()),
                    static_cast<Eigen::Index>(basis.size()));
  Vector3 q_m = line_m;
  for (std::size_t i = 0; i < positions_m.size(); ++i) {
    q_m(static_cast<Eigen::Index>(index(translation.axis))) = positions_m[i];
    A.row(static_cast<Eigen::Index>(i)) =
        component_row(basis, tool_m, q_m, direction(translation.motion));
  }
  return A;
}

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
  if (line_m_ && !is_rotation(motion_.motion)) {
    return rows_along(*model_->tables(), model_->tool_offsets_m().front(), motion_, *line_m_,
                      positions_m);
  }
  Eigen::MatrixXd A(static_cast<Eigen::Index>(positions_m.size()), model_->U().size());
  for (std::size_t i = 0; i < positions_m.size(); ++i) {
    A.row(static_cast<Eigen::Index>(i)) = table_row(*model_, motion_, positions_m[i]);
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
