#include "abbe/calib/internal/model/datum_coordinates.hpp"

#include <Eigen/QR>

#include "abbe/calib/model/model_datum.hpp"

namespace abbe::calib {
namespace {

std::vector<DatumGroup> groups_of(const ParameterLayout& layout) {
  std::vector<DatumGroup> groups;
  for (const Table& table : layout.tables()) {
    groups.push_back({.name = name(table.motion),
                      .motion = table.motion,
                      .offset = static_cast<Eigen::Index>(table.offset),
                      .count = static_cast<Eigen::Index>(layout.node_count(table.motion.axis))});
  }

  auto offset = static_cast<Eigen::Index>(layout.squareness_offset());
  for (const std::string_view squareness : kSquarenessNames) {
    groups.push_back({.name = std::string(squareness), .offset = offset++, .count = 1});
  }

  return groups;
}

/// Orthonormal basis of the parameter changes that satisfy the conditions K U = 0.
Eigen::MatrixXd free_of(const Eigen::MatrixXd& K) {
  std::vector<Eigen::Index> conditions;
  for (Eigen::Index i = 0; i < K.rows(); ++i) {
    if ((K.row(i).array() != 0.0).any()) {
      conditions.push_back(i);
    }
  }

  const Eigen::Index n = K.cols(), fixed = std::ssize(conditions);
  if (fixed == 0) {
    return Eigen::MatrixXd::Identity(n, n);
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(K(conditions, Eigen::all).transpose());
  const Eigen::MatrixXd Q = qr.householderQ() * Eigen::MatrixXd::Identity(n, n);
  return Q.rightCols(n - fixed);
}

}  // namespace

Eigen::MatrixXd DatumCoordinates::of_group(const DatumGroup& group,
                                           const Eigen::MatrixXd& matrix) const {
  return N.block(group.offset, group.first, group.count, group.size).transpose() *
         matrix.middleRows(group.offset, group.count);
}

bool is_in_datum(const DatumCoordinates& c, const Eigen::MatrixXd& covariance) {
  constexpr double kRounding = 1e-6;
  const double all = covariance.trace();
  const double in_datum = (covariance * c.N).cwiseProduct(c.N).sum();
  return all - in_datum <= kRounding * all;
}

DatumCoordinates datum_coordinates(const TableBasis& basis) {
  const Eigen::MatrixXd K = datum_conditions(ModelDatum::G2, basis, basis.size());
  DatumCoordinates c{.N = {}, .groups = groups_of(basis.layout())};
  std::vector<Eigen::MatrixXd> parts;
  Eigen::Index size = 0;
  for (DatumGroup& group : c.groups) {
    parts.push_back(free_of(K.middleCols(group.offset, group.count)));
    group.first = size;
    group.size = parts.back().cols();
    size += group.size;
  }

  c.N = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(basis.size()), size);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const DatumGroup& group = c.groups[i];
    c.N.block(group.offset, group.first, group.count, group.size) = parts[i];
  }

  return c;
}

Eigen::VectorXd smooth_change(const DatumGroup& group, const ParameterLayout& layout) {
  Eigen::VectorXd shape = Eigen::VectorXd::Ones(group.count);
  if (!group.motion) {
    return shape;
  }

  const AxisNodes& axis = layout.nodes()[index(group.motion->axis)];
  const double low_m = axis.nodes_m.front(), high_m = axis.nodes_m.back();
  for (Eigen::Index i = 0; i < group.count; ++i) {
    const double q_m = axis.nodes_m[static_cast<std::size_t>(i)];
    shape(i) =
        is_straightness(*group.motion) ? (q_m - low_m) * (high_m - q_m) : q_m - axis.reference_m;
  }
  const double largest = shape.cwiseAbs().maxCoeff();
  return largest > 0.0 ? Eigen::VectorXd(shape / largest) : shape;
}

}  // namespace abbe::calib
