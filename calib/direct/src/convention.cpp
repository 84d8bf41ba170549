#include "abbe/calib/internal/direct/convention.hpp"

#include <iomanip>
#include <sstream>

#include "abbe/calib/geometry/linear_interpolation.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"

namespace abbe::calib::direct {
namespace {

Eigen::VectorXd as_vector(std::span<const double> values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// Row w: w * values is the value that the fitted line has at its origin `at_m`.
Eigen::RowVectorXd value_row(std::span<const double> positions_m, StraightnessLine line,
                             double at_m) {
  const auto n = static_cast<Eigen::Index>(positions_m.size());
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(n);
  if (line == StraightnessLine::EndPoints) {
    row(0) = 1.0;
    return row + (at_m - positions_m.front()) * slope_row(positions_m, line);
  }
  row.setConstant(1.0 / static_cast<double>(n));
  return row + (at_m - as_vector(positions_m).mean()) * slope_row(positions_m, line);
}

}  // namespace

std::string three_digits(double value) {
  std::ostringstream out;
  out << std::setprecision(3) << value;
  return out.str();
}

std::size_t conditions_of(ErrorMotion motion) {
  return is_straightness(motion) ? 2 : 1;
}

double zero_position_m(std::span<const double> positions_m, double reference_m) {
  const bool inside = reference_m >= positions_m.front() && reference_m <= positions_m.back();
  return inside ? reference_m : positions_m.front();
}

Eigen::RowVectorXd slope_row(std::span<const double> positions_m, StraightnessLine line) {
  const auto n = static_cast<Eigen::Index>(positions_m.size());
  if (line == StraightnessLine::EndPoints) {
    const double length_m = positions_m.back() - positions_m.front();
    Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(n);
    row(0) = -1.0 / length_m;
    row(n - 1) = 1.0 / length_m;
    return row;
  }
  const Eigen::VectorXd p = as_vector(positions_m);
  const Eigen::VectorXd centred = p.array() - p.mean();
  return centred.transpose() / centred.squaredNorm();
}

Eigen::MatrixXd reduction(ErrorMotion motion, std::span<const double> positions_m,
                          double reference_m, StraightnessLine line) {
  const auto n = static_cast<Eigen::Index>(positions_m.size());
  Eigen::MatrixXd P = Eigen::MatrixXd::Identity(n, n);
  if (is_straightness(motion)) {
    for (Eigen::Index i = 0; i < n; ++i) {
      P.row(i) -= value_row(positions_m, line, positions_m[static_cast<std::size_t>(i)]);
    }
    return P;
  }

  const BasisRow zero = basis_row(positions_m, zero_position_m(positions_m, reference_m));
  for (std::size_t k = 0; k < 2; ++k) {
    P.col(static_cast<Eigen::Index>(zero.first + k)).array() -= zero.weight[k];
  }
  return P;
}

/// Matrix W: W * (values at the positions) is the linear interpolation at the nodes.
Eigen::MatrixXd interpolation_matrix(std::span<const double> positions_m,
                                     std::span<const double> nodes_m) {
  Eigen::MatrixXd W = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(nodes_m.size()),
                                            static_cast<Eigen::Index>(positions_m.size()));
  for (std::size_t i = 0; i < nodes_m.size(); ++i) {
    const BasisRow row = basis_row(positions_m, nodes_m[i]);
    W(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(row.first)) = row.weight[0];
    W(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(row.first + 1)) = row.weight[1];
  }
  return W;
}

std::string convention_text(ErrorMotion motion, std::span<const double> positions_m,
                            double reference_m, StraightnessLine line) {
  if (!is_straightness(motion)) {
    return message("zero at ", kMmPerM * zero_position_m(positions_m, reference_m), " mm");
  }
  const double first_mm = kMmPerM * positions_m.front(), last_mm = kMmPerM * positions_m.back();
  return line == StraightnessLine::EndPoints
             ? message("line through ", first_mm, " and ", last_mm, " mm removed")
             : message("least-squares line from ", first_mm, " to ", last_mm, " mm removed");
}

}  // namespace abbe::calib::direct
