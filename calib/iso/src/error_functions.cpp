#include "error_functions.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/calib/model/backlash.hpp"

namespace abbe::calib::iso {
namespace {

/// Joint covariance of tables and differences between directions. The covariance of the model
/// contains half the differences, because it is for an unknown direction of travel. Here the
/// direction is known, and this part is removed.
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

const TableBasis& basis_of(const VolumetricModel& model) {
  return model.travel() != nullptr ? *model.travel_tables() : *model.tables();
}

/// Draws errors e with the given covariance: e = P^T L D^(1/2) z with cov = P^T L D L^T P and
/// standard normal z, one per column. The same covariance gives the same draws in every run.
Eigen::MatrixXd drawn_from(const Eigen::MatrixXd& covariance) {
  constexpr Eigen::Index kDraws = 128;  // and their opposites; a mean then has an error of 6 % of
                                        // the scatter
  const Eigen::LDLT<Eigen::MatrixXd> factors(covariance);
  NormalDeviates normal(1);
  Eigen::MatrixXd z(covariance.rows(), kDraws);
  for (double& one : z.reshaped()) {
    one = normal.next();
  }
  z = factors.vectorD().cwiseMax(0.0).cwiseSqrt().asDiagonal() * z;
  z = factors.matrixL() * z;
  return factors.transpositionsP().transpose() * z;
}

/// The volume is divided into at most this number of cells along each axis. The misfit of V is
/// constant within a cell.
constexpr int kMostCells = 5;

/// True if the coefficients are only rounding errors. Coefficients are 1 for translations and
/// levers in metres for rotations.
template <class Derived>
bool is_none(const Eigen::MatrixBase<Derived>& coefficients) {
  constexpr double kRounding = 1e-9;
  return coefficients.cwiseAbs().maxCoeff() < kRounding;
}

}  // namespace

ErrorFunctions::ErrorFunctions(const VolumetricModel& model)
    : model_(&model), U_(model.U()), covariance_(covariance_with_travel(model)) {
  if (model.travel() != nullptr) {
    U_.conservativeResize(covariance_.rows());
    U_.tail(model.travel()->D.size()) = model.travel()->D;
  }
  if (model.misfit() != nullptr) {
    add_misfit();
  }
  drawn_errors_ = drawn_from(covariance_);

  undetermined_.assign(static_cast<std::size_t>(model.U().size()), false);
  for (const Backlash& difference : backlash_of(model)) {
    undetermined_.push_back(!difference.determined);
  }
  undetermined_.resize(static_cast<std::size_t>(U_.size()), false);
}

void ErrorFunctions::add_misfit() {
  const Misfit& misfit = *model_->misfit();
  covariance_.diagonal().head(misfit.u_of_parameters.size()) += misfit.u_of_parameters.cwiseAbs2();
  const std::span<const Vector3> vertices_m = model_->validity().vertices_m();
  if (!(misfit.u_V_m.maxCoeff() > 0.0) || vertices_m.empty()) {
    return;
  }

  Vector3 high_m = vertices_m.front();
  low_m_ = high_m;
  for (const Vector3& v : vertices_m) {
    low_m_ = low_m_.cwiseMin(v);
    high_m = high_m.cwiseMax(v);
  }
  cell_m_ = ((high_m - low_m_) / kMostCells).cwiseMax(std::max(misfit.V_length_m, 1e-6));

  misfit_ = U_.size();
  constexpr Eigen::Index kUnknowns = 3 * kMostCells * kMostCells * kMostCells;
  U_.conservativeResizeLike(Eigen::VectorXd::Zero(misfit_ + kUnknowns));
  covariance_.conservativeResizeLike(Eigen::MatrixXd::Zero(U_.size(), U_.size()));
  for (Eigen::Index i = 0; i < kUnknowns; ++i) {
    covariance_(misfit_ + i, misfit_ + i) = misfit.u_V_m(i % 3) * misfit.u_V_m(i % 3);
  }
}

Eigen::Index ErrorFunctions::misfit_at(const Vector3& q_m) const {
  Eigen::Index cell = 0;
  for (Eigen::Index a = 0; a < 3; ++a) {
    const double place = (q_m(a) - low_m_(a)) / cell_m_(a);
    cell = cell * kMostCells + static_cast<Eigen::Index>(std::clamp(place, 0.0, kMostCells - 0.5));
  }
  return misfit_ + 3 * cell;
}

Eigen::RowVectorXd ErrorFunctions::row(const Vector3& q_m, const Vector3& along,
                                       const AxisTravel& travel) const {
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(U_.size());
  if (misfit_ >= 0) {
    row.segment<3>(misfit_at(q_m)) = along.transpose();
  }
  if (const PolynomialModel* polynomials = model_->polynomials(); polynomials != nullptr) {
    row.head(model_->U().size()) = along.transpose() * polynomials->design().B(q_m);
    return row;
  }

  const TableBasis& basis = basis_of(*model_);
  std::vector<Column> memory(basis.most_columns());
  ModelColumns columns(memory);
  basis.append_columns(
      {.q_m = q_m, .tool_offset_m = model_->tool_offsets_m().front(), .travel = travel}, columns);
  for (const Column& c : columns.span()) {
    row(static_cast<Eigen::Index>(c.parameter)) += along.dot(c.dV_dU);
  }
  return row;
}

Eigen::RowVectorXd ErrorFunctions::table_row(const Table& table, double position_m) const {
  const NodeWeights weights = model_->tables()->interpolation(table.motion.axis).at(position_m);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(U_.size());
  for (std::size_t i = 0; i < weights.count(); ++i) {
    row(static_cast<Eigen::Index>(table.offset + weights.first() + i)) = weights[i];
  }
  return row;
}

Value ErrorFunctions::with_u(const Eigen::RowVectorXd& row) const {
  const double variance = row * covariance_ * row.transpose();
  return {value(row), std::sqrt(std::max(0.0, variance)), !is_none(row)};
}

bool ErrorFunctions::has_undetermined_travel(const Eigen::MatrixXd& rows) const {
  for (Eigen::Index i = 0; i < rows.cols(); ++i) {
    if (undetermined_[static_cast<std::size_t>(i)] && !is_none(rows.col(i))) {
      return true;
    }
  }
  return false;
}

Value range_of(const ErrorFunctions& functions, const Eigen::MatrixXd& rows) {
  const Eigen::MatrixXd centred = rows.rowwise() - rows.colwise().mean();
  Eigen::VectorXd y(rows.rows());
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    y(i) = functions.value(centred.row(i));
  }

  const auto range = [](const Eigen::VectorXd& v) { return v.maxCoeff() - v.minCoeff(); };
  Eigen::Index high = 0, low = 0;
  y.maxCoeff(&high);
  y.minCoeff(&low);
  const Value difference = functions.with_u(rows.row(high) - rows.row(low));
  const Eigen::MatrixXd drawn = centred * functions.drawn_errors();
  return {difference.value, u_of(difference.u, y, drawn, drawn.row(high) - drawn.row(low), range),
          !is_none(centred)};
}

Value largest_of(const ErrorFunctions& functions, const Eigen::MatrixXd& rows) {
  Eigen::VectorXd y(rows.rows());
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    y(i) = functions.value(rows.row(i));
  }

  const auto largest = [](const Eigen::VectorXd& v) { return v.cwiseAbs().maxCoeff(); };
  Eigen::Index at = 0;
  y.cwiseAbs().maxCoeff(&at);
  const Value value = functions.with_u(rows.row(at));
  const Eigen::MatrixXd drawn = rows * functions.drawn_errors();
  return {value.value, u_of(value.u, y, drawn, drawn.row(at), largest), !is_none(rows)};
}

std::optional<Bidirectional> bidirectional_of(const ErrorFunctions& functions,
                                              const Eigen::MatrixXd& up,
                                              const Eigen::MatrixXd& down) {
  const Eigen::MatrixXd difference = up - down;
  if (functions.has_undetermined_travel(difference)) {
    return std::nullopt;
  }
  Eigen::MatrixXd both(up.rows() + down.rows(), up.cols());
  both << up, down;
  return Bidirectional{range_of(functions, both), largest_of(functions, difference)};
}

}  // namespace abbe::calib::iso
