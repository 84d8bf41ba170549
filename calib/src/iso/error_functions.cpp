#include "iso/error_functions.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::calib::iso {
namespace {

/// Covariance of tables and differences. That of the model contains half the differences, because
/// there the direction of travel is not known; here it is.
Eigen::MatrixXd covariance_with_travel(const VolumetricModel& model) {
  if (model.travel() == nullptr) {
    return model.covariance();
  }
  const TravelDifferences& d = *model.travel();
  const Eigen::MatrixXd half = half_differences(*model.travel_tables(), d.D);
  const Eigen::Index n = d.cov_U_D.rows(), m = d.D.size();
  Eigen::MatrixXd all(n + m, n + m);
  all.topLeftCorner(n, n) = model.covariance() - half * half.transpose();
  all.topRightCorner(n, m) = d.cov_U_D;
  all.bottomLeftCorner(m, n) = d.cov_U_D.transpose();
  all.bottomRightCorner(m, m) = d.covariance;
  return all;
}

const estimation::TableBasis& basis_of(const VolumetricModel& model) {
  return model.travel() != nullptr ? *model.travel_tables() : *model.tables();
}

}  // namespace

ErrorFunctions::ErrorFunctions(const VolumetricModel& model)
    : model_(&model), U_(model.U()), covariance_(covariance_with_travel(model)) {
  if (model.travel() != nullptr) {
    U_.conservativeResize(covariance_.rows());
    U_.tail(model.travel()->D.size()) = model.travel()->D;
  }
}

Eigen::RowVectorXd ErrorFunctions::row(const Vector3& q_m, const Vector3& along,
                                       const estimation::AxisTravel& travel) const {
  if (const evemu::EvemuModel* polynomials = model_->polynomials(); polynomials != nullptr) {
    return along.transpose() * polynomials->design().B(q_m);
  }

  const estimation::TableBasis& basis = basis_of(*model_);
  std::vector<estimation::Column> memory(basis.most_columns());
  estimation::ModelColumns columns(memory);
  basis.append_columns(
      {.q_m = q_m, .tool_offset_m = model_->tool_offsets_m().front(), .travel = travel}, columns);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(U_.size());
  for (const estimation::Column& c : columns.span()) {
    row(static_cast<Eigen::Index>(c.parameter)) += along.dot(c.dV_dU);
  }
  return row;
}

Eigen::RowVectorXd ErrorFunctions::table_row(const Table& table, double position_m) const {
  const estimation::NodeWeights weights =
      model_->tables()->interpolation(table.motion.axis).at(position_m);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(U_.size());
  for (std::size_t i = 0; i < weights.count(); ++i) {
    row(static_cast<Eigen::Index>(table.offset + weights.first() + i)) = weights[i];
  }
  return row;
}

Value ErrorFunctions::with_u(const Eigen::RowVectorXd& row) const {
  const double variance = row * covariance_ * row.transpose();
  return {value(row), std::sqrt(std::max(0.0, variance))};
}

Value range_of(const ErrorFunctions& functions, const Eigen::MatrixXd& rows) {
  Eigen::Index high = 0, low = 0;
  double largest = functions.value(rows.row(0)), smallest = largest;
  for (Eigen::Index i = 1; i < rows.rows(); ++i) {
    const double value = functions.value(rows.row(i));
    if (value > largest) {
      largest = value;
      high = i;
    }
    if (value < smallest) {
      smallest = value;
      low = i;
    }
  }
  return functions.with_u(rows.row(high) - rows.row(low));
}

Value largest_of(const ErrorFunctions& functions, const Eigen::MatrixXd& rows) {
  Eigen::Index at = 0;
  for (Eigen::Index i = 1; i < rows.rows(); ++i) {
    if (std::abs(functions.value(rows.row(i))) > std::abs(functions.value(rows.row(at)))) {
      at = i;
    }
  }
  return functions.with_u(rows.row(at));
}

}  // namespace abbe::calib::iso
