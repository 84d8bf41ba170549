#include "abbe/calib/model/volumetric_model.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/geometry/cell_form.hpp"
#include "abbe/calib/internal/geometry/checked_nodes.hpp"
#include "abbe/calib/internal/model/tool_span.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Covariance of V: sum_ij v_i C_ij v_j^T over the non-zero columns v_i = dV/dU_i, C: covariance of
/// the parameters U.
Matrix3 propagate(std::span<const Column> columns, const Eigen::MatrixXd& covariance) {
  const double* data = covariance.data();
  const auto stride = static_cast<std::size_t>(covariance.rows());
  Matrix3 half = Matrix3::Zero();  // half + half^T is the result

  for (std::size_t j = 0; j < columns.size(); ++j) {
    const Column& cj = columns[j];
    const double* row = data + cj.parameter * stride;
    Vector3 sum = 0.5 * row[cj.parameter] * cj.dV_dU;
    for (std::size_t i = 0; i < j; ++i) {
      sum += row[columns[i].parameter] * columns[i].dV_dU;
    }
    half.noalias() += sum * cj.dV_dU.transpose();
  }

  return half + half.transpose();
}

Result<void> check_shape(const Eigen::MatrixXd& C, std::size_t parameters) {
  const auto n = static_cast<Eigen::Index>(parameters);
  if (C.rows() != n || C.cols() != n) {
    return failure(ErrorCode::BadInput, message("model: covariance is ", C.rows(), " x ", C.cols(),
                                                ", parameters are ", parameters));
  }

  if (!C.allFinite()) {
    return failure(ErrorCode::NotFinite, "model: covariance contains a value that is not a number");
  }

  if (!C.isApprox(C.transpose(), 1e-12)) {
    return failure(ErrorCode::BadInput, "model: covariance is not symmetric");
  }

  if (n > 0 && C.diagonal().minCoeff() < 0) {
    return failure(ErrorCode::BadInput, "model: covariance has a negative variance");
  }

  return {};
}

/// Grid of kCells cells per axis over the bounding box of the hull. Polynomials up to order 5 have
/// less than one turning point in a quarter of the box.
MachineNodes grid_over(const ValidityVolume& validity) {
  constexpr int kCells = 8;
  const ReadingBox box = bounding_box(validity.vertices_m());
  MachineNodes nodes;
  for (Eigen::Index a = 0; a < 3; ++a) {
    AxisNodes& axis = nodes[static_cast<std::size_t>(a)];
    for (int k = 0; k <= kCells; ++k) {
      const double u = 2.0 * k / kCells - 1.0;
      axis.nodes_m.push_back(box.centre_m(a) + u * box.half_width_m(a));
    }
    axis.reference_m = axis.nodes_m.front();
  }
  return nodes;
}

}  // namespace

Result<void> check_covariance(const Eigen::MatrixXd& C) {
  if (Result<void> valid = check_shape(C, static_cast<std::size_t>(C.rows())); !valid) {
    return valid;
  }

  // The covariance is scaled to correlations. A variance below 1e-12 of the largest belongs to a
  // parameter that the datum fixes, and is only rounding.
  const double least = 1e-12 * (C.size() > 0 ? C.diagonal().maxCoeff() : 0.0);
  const Eigen::VectorXd scale = C.diagonal().unaryExpr(
      [&](double variance) { return least > 0 ? 1 / std::sqrt(std::max(variance, least)) : 1.0; });
  Eigen::MatrixXd correlation = scale.asDiagonal() * C * scale.asDiagonal();

  // The covariance of parameters that satisfy datum conditions is singular. With ill-conditioned
  // data (condition number 1e5) rounding changes its eigenvalues by 1e-6, so zero may become
  // negative.
  constexpr double kRounding = 1e-6;
  correlation.diagonal().array() += kRounding;
  if (Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(correlation).info() != Eigen::Success) {
    return failure(
        ErrorCode::BadInput,
        "model: covariance is not positive semidefinite: some combination of parameters has a "
        "negative variance");
  }

  return {};
}

Result<VolumetricModel> VolumetricModel::from_vector(const TableBasis& basis, ModelDatum datum,
                                                     std::span<const Vector3> tool_offsets_m,
                                                     const Eigen::VectorXd& U,
                                                     const Eigen::MatrixXd& covariance,
                                                     ValidityVolume validity) {
  return from_vector(basis.layout(), datum, tool_offsets_m, U, covariance, std::move(validity),
                     basis.interpolation(Axis::X).kind());
}

Result<VolumetricModel> VolumetricModel::from_vector(
    const ParameterLayout& layout, ModelDatum datum, std::span<const Vector3> tool_offsets_m,
    const Eigen::VectorXd& U, const Eigen::MatrixXd& covariance, ValidityVolume validity,
    Interpolation interpolation) {
  if (U.size() != static_cast<Eigen::Index>(layout.model_size())) {
    return failure(ErrorCode::BadInput, message("model: ", U.size(), " values for ",
                                                layout.model_size(), " parameters"));
  }

  if (!U.allFinite()) {
    return failure(ErrorCode::NotFinite, "model: a parameter is not a number");
  }

  ABBE_TRY(check_shape(covariance, layout.model_size()));

  if (tool_offsets_m.empty()) {
    return failure(ErrorCode::BadInput, "model: no tool offset given");
  }

  if (tool_offsets_m.size() > 1 && layout.tables().size() != kAllAxes.size() * kAllMotions.size()) {
    return failure(ErrorCode::BadInput, message("model: several tool offsets, but only ",
                                                layout.tables().size(), " of 18 tables"));
  }

  for (const Vector3& t : tool_offsets_m) {
    if (!t.allFinite()) {
      return failure(ErrorCode::NotFinite, "model: a tool offset is not a number");
    }
  }

  const bool cubic = interpolation != Interpolation::Linear;
  const Vector3 squareness_from_m =
      datum == ModelDatum::G1 ? Vector3(Vector3::Zero()) : reference_position_m(layout.nodes());
  Result<TableBasis> basis = TableBasis::of(layout.with_squareness_from(squareness_from_m),
                                            TableOptions::all_axes(interpolation));
  ABBE_TRY(basis);

  VolumetricModel model(*std::move(basis),
                        cubic ? checked_nodes_of_cubic(layout.nodes()) : layout.nodes());
  model.datum_ = datum;
  model.tool_offsets_m_.assign(tool_offsets_m.begin(), tool_offsets_m.end());
  const ToolSpan tools = tool_span(tool_offsets_m);
  model.holds_for_any_tool_ = tools.any;
  model.tool_line_ = tools.line;
  model.U_ = U;
  model.covariance_ = covariance;
  model.validity_ = std::move(validity);
  if (cubic) {
    model.Z_ = with_curvatures(*model.tables(), U);
    model.cov_Z_ = covariance_with_curvatures(*model.tables(), covariance);
  }

  return model;
}

Result<VolumetricModel> VolumetricModel::from_polynomials(PolynomialModel model, ModelDatum datum,
                                                          const Vector3& tool_offset_m,
                                                          ValidityVolume validity) {
  if (!tool_offset_m.allFinite()) {
    return failure(ErrorCode::NotFinite, "model: the tool offset is not a number");
  }

  if (is_of_tables(datum)) {
    return failure(ErrorCode::BadInput, message("model: datum ", name(datum),
                                                " is for tables; polynomials need datum Ball1"));
  }

  MachineNodes nodes = grid_over(validity);
  for (const Axis a : kAllAxes) {
    if (Result<void> valid = check_nodes(nodes[index(a)].nodes_m); !valid) {
      return failure(valid.error().code,
                     message("model: axis ", letter(a), ": ", valid.error().text));
    }
  }

  Eigen::VectorXd c_m = model.c_m();
  Eigen::MatrixXd covariance_m2 = model.covariance_m2();
  VolumetricModel result(std::move(model), std::move(nodes));
  result.datum_ = datum;
  result.tool_offsets_m_ = {tool_offset_m};
  result.U_ = std::move(c_m);
  result.covariance_ = std::move(covariance_m2);
  result.validity_ = std::move(validity);

  return result;
}

bool VolumetricModel::holds_for_tool(const Vector3& tool_offset_m) const {
  if (!tool_offset_m.allFinite()) {
    return false;
  }
  return holds_for_any_tool_ ||
         (tool_offset_m - lever_offset_m(tool_offset_m)).norm() <= kToolTolerance_m;
}

Vector3 VolumetricModel::lever_offset_m(const Vector3& offset_m) const {
  // The tables include the effect of the components of the tool offset perpendicular to the line of
  // the tools with which they were measured. An offset that differs slightly is therefore projected
  // onto the line: if it were not, only some of the rotations would act on the difference.
  const Vector3& first = tool_offsets_m_.front();
  return holds_for_any_tool_ ? offset_m
                             : Vector3(first + tool_line_ * tool_line_.dot(offset_m - first));
}

VolumetricError VolumetricModel::error_at(const Vector3& axis_position_m,
                                          const Vector3& tool_offset_m) const {
  VolumetricError e;
  e.inside = validity_.contains(axis_position_m);
  e.tool_ok = holds_for_tool(tool_offset_m);

  if (!e.tool_ok) {
    e.V_m.setConstant(kNaN);
    e.cov_V_m2.setConstant(kNaN);
    return e;
  }

  if (const PolynomialModel* model = polynomials()) {
    model->V_and_cov_at(axis_position_m, e.V_m, e.cov_V_m2);
    e.cov_V_m2 += misfit_cov_V_m2(axis_position_m, tool_offset_m);
    return e;
  }

  std::array<Column, kMostCellColumns> memory;
  ModelColumns columns(memory);
  const MachineState state{.q_m = axis_position_m, .tool_offset_m = lever_offset_m(tool_offset_m)};
  const bool linear = linear_between_nodes();
  if (linear) {
    tables()->append_columns(state, columns);
  } else {
    append_cell_columns(*tables(), state, columns);
  }

  const Eigen::VectorXd& U = linear ? U_ : Z_;
  for (const Column& c : columns.span()) {
    e.V_m += c.dV_dU * U(static_cast<Eigen::Index>(c.parameter));
  }

  e.cov_V_m2 = propagate(columns.span(), linear ? covariance_ : cov_Z_);
  e.cov_V_m2 += misfit_cov_V_m2(axis_position_m, tool_offset_m);
  return e;
}

Vector3 VolumetricModel::V_at(const Vector3& axis_position_m, const Vector3& tool_offset_m) const {
  if (!holds_for_tool(tool_offset_m)) {
    return Vector3::Constant(kNaN);
  }
  if (const PolynomialModel* model = polynomials()) {
    return model->V_at(axis_position_m);
  }
  return tables()->V_m({.q_m = axis_position_m, .tool_offset_m = lever_offset_m(tool_offset_m)},
                       {U_.data(), static_cast<std::size_t>(U_.size())});
}

Result<Correction> VolumetricModel::command_correction(const Vector3& nominal_m,
                                                       const Vector3& tool_offset_m,
                                                       const AxisTravel& travel) const {
  if (!holds_for_tool(tool_offset_m)) {
    return failure(ErrorCode::NotApplicable,
                   message("correction for tool offset ", mm_text(tool_offset_m),
                           ": the model is valid for ", mm_text(tool_offsets_m_.front())));
  }

  if (!nominal_m.allFinite()) {
    return failure(ErrorCode::NotFinite, "correction: the position is not a number");
  }

  constexpr double kSettled_m = 1e-9;
  constexpr int kMostEvaluations = 50;
  Correction correction;
  correction.inside = validity_.contains(nominal_m);

  while (correction.evaluations < kMostEvaluations) {
    const Vector3 next = -V_at(nominal_m + correction.c_m, tool_offset_m, travel);
    const double step_m = (next - correction.c_m).norm();
    correction.c_m = next;
    ++correction.evaluations;
    if (step_m < kSettled_m) {
      return correction;
    }
  }

  return failure(ErrorCode::NotConverged,
                 message("correction at (", nominal_m.transpose(), ") m: no convergence after ",
                         kMostEvaluations, " evaluations"));
}

const KinematicChain& VolumetricModel::chain() const {
  return tables() == nullptr ? polynomials()->design().equivalent().chain()
                             : tables()->layout().chain();
}

}  // namespace abbe::calib
