// The part of VolumetricModel that depends on the direction of travel.
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/geometry/effect_of_travel.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib {
namespace {

Result<void> check_sizes(const TravelDifferences& d, const TableBasis& basis) {
  const auto n = static_cast<Eigen::Index>(basis.layout().model_size());
  const auto m = static_cast<Eigen::Index>(basis.size()) - n;
  if (d.D.size() != m || d.covariance.rows() != m || d.covariance.cols() != m ||
      d.cov_U_D.rows() != n || d.cov_U_D.cols() != m) {
    return failure(ErrorCode::BadInput,
                   message("model: ", d.D.size(),
                           " differences between the directions of travel, "
                           "covariance ",
                           d.covariance.rows(), " x ", d.covariance.cols(), " and ",
                           d.cov_U_D.rows(), " x ", d.cov_U_D.cols(), "; the tables need ", m,
                           " with ", m, " x ", m, " and ", n, " x ", m));
  }

  if (!d.D.allFinite() || !d.covariance.allFinite() || !d.cov_U_D.allFinite()) {
    return failure(ErrorCode::NotFinite,
                   "model: a difference between the directions of travel, or its covariance, is "
                   "not a number");
  }
  return {};
}

/// Joint covariance of tables and differences. Half the differences, which the covariance of the
/// mean contains, are subtracted.
Eigen::MatrixXd whole_covariance(const VolumetricModel& model) {
  const TravelDifferences& d = *model.travel();
  const Eigen::MatrixXd half = half_differences(*model.travel_tables(), d.D);
  const Eigen::Index n = d.cov_U_D.rows(), m = d.D.size();
  Eigen::MatrixXd whole(n + m, n + m);
  whole.topLeftCorner(n, n) = model.covariance() - half * half.transpose();
  whole.topRightCorner(n, m) = d.cov_U_D;
  whole.bottomLeftCorner(m, n) = d.cov_U_D.transpose();
  whole.bottomRightCorner(m, m) = d.covariance;
  return whole;
}

}  // namespace

Result<VolumetricModel> VolumetricModel::with_travel(TravelDifferences differences) const {
  if (tables() == nullptr || differences.kind == TravelDependence::None) {
    return failure(ErrorCode::BadInput,
                   "model: differences between the directions of travel need tables");
  }

  TableOptions options = tables()->options();
  options.travel = differences.kind;
  Result<TableBasis> basis = TableBasis::of(tables()->layout(), options);
  ABBE_TRY(basis);
  ABBE_TRY(check_sizes(differences, *basis));

  VolumetricModel model = *this;
  Eigen::VectorXd U_and_D(U_.size() + differences.D.size());
  U_and_D << U_, differences.D;
  model.travel_ = TravelForm{*std::move(basis), std::move(differences), std::move(U_and_D)};
  if (!check_covariance(whole_covariance(model))) {
    return failure(ErrorCode::BadInput,
                   "model: covariance of the differences between the directions of travel is not "
                   "positive semidefinite together with that of the tables");
  }
  return model;
}

VolumetricError VolumetricModel::error_at(const Vector3& axis_position_m,
                                          const Vector3& tool_offset_m,
                                          const AxisTravel& travel) const {
  VolumetricError e = error_at(axis_position_m, tool_offset_m);
  if (!travel_ || !e.tool_ok) {
    return e;
  }
  const TravelEffect effect = effect_of_travel(
      travel_->basis, travel_->differences,
      {.q_m = axis_position_m, .tool_offset_m = lever_offset_m(tool_offset_m), .travel = travel});
  e.V_m += effect.V_m;
  e.cov_V_m2 += effect.cov_m2;
  e.cov_V_m2.diagonal() = e.cov_V_m2.diagonal().cwiseMax(0.0);  // removes negative rounding errors
  return e;
}

Vector3 VolumetricModel::V_at(const Vector3& axis_position_m, const Vector3& tool_offset_m,
                              const AxisTravel& travel) const {
  if (!travel_ || !holds_for_tool(tool_offset_m)) {
    return V_at(axis_position_m, tool_offset_m);
  }
  return travel_->basis.V_m(
      {.q_m = axis_position_m, .tool_offset_m = lever_offset_m(tool_offset_m), .travel = travel},
      {travel_->U_and_D.data(), static_cast<std::size_t>(travel_->U_and_D.size())});
}

}  // namespace abbe::calib
