#include "nests/nest_information.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::otf {
namespace {

/// Standard deviation of the prior of a nest's position. It only affects how much evidence is
/// needed to find that a nest moved.
constexpr double kPosition_m = 1e-3;

std::size_t places(const std::vector<std::size_t>& place) {
  return place.empty() ? 0 : *std::max_element(place.begin(), place.end()) + 1;
}

/// First column that is not zero, and number of columns from it to the last one that is not zero.
std::pair<Eigen::Index, Eigen::Index> columns_with_values(const Eigen::MatrixXd& H) {
  Eigen::Index first = 0, end = H.cols();
  while (first < end && H.col(first).isZero(0.0)) {
    ++first;
  }
  while (end > first && H.col(end - 1).isZero(0.0)) {
    --end;
  }
  return {first, end - first};
}

}  // namespace

NestRows::NestRows(const DriftObservations& d, const DriftBasis& basis) : size_(basis.size()) {
  std::map<std::size_t, Vector3> first_visit;
  for (const NestVisit& visit : d.visits) {
    const Vector3 origin = first_visit.emplace(visit.nest, visit.mean_tracker_m).first->second;
    const Eigen::MatrixXd H = basis.dp_dc(visit.time_s, visit.mean_tracker_m);
    const auto [first, count] = columns_with_values(H);
    rows_.push_back(
        {first, H.middleCols(first, count), visit.mean_tracker_m - origin, visit.cov_tracker_m2});
  }
}

Matrix3 NestRows::weight(std::size_t visit, double u_m) const {
  return (rows_[visit].cov_m2 + u_m * u_m * Matrix3::Identity()).inverse();
}

NestInformation NestRows::information(const std::vector<std::size_t>& place, double u_m) const {
  const auto n = static_cast<Eigen::Index>(size_);
  NestInformation all{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n), 0.0};
  for (std::size_t at = 0; at < places(place); ++at) {
    Matrix3 W = Matrix3::Zero();
    Vector3 Wz = Vector3::Zero();
    Eigen::MatrixXd WH = Eigen::MatrixXd::Zero(3, n);

    for (std::size_t v = 0; v < rows_.size(); ++v) {
      if (place[v] == at) {
        const Row& row = rows_[v];
        const Matrix3 w = weight(v, u_m);
        const Eigen::MatrixXd wH = w * row.H;
        W += w;
        Wz += w * row.z_m;
        const Eigen::Index begin = row.first_column, count = row.H.cols();
        WH.middleCols(begin, count) += wH;
        all.N.block(begin, begin, count, count) += row.H.transpose() * wH;
        all.Nc.segment(begin, count) += wH.transpose() * row.z_m;
        all.constant += row.z_m.dot(w * row.z_m) - natural_logarithm(w.determinant());
      }
    }

    const Matrix3 cov = W.inverse();
    all.N -= WH.transpose() * cov * WH;
    all.Nc -= WH.transpose() * (cov * Wz);
    all.constant += natural_logarithm(W.determinant()) - Wz.dot(cov * Wz) +
                    6.0 * natural_logarithm(kPosition_m);
  }
  return all;
}

std::vector<Vector3> NestRows::measured_m(const Eigen::VectorXd& c) const {
  std::vector<Vector3> all;
  for (const Row& row : rows_) {
    all.emplace_back(row.z_m - row.H * c.segment(row.first_column, row.H.cols()));
  }
  return all;
}

std::vector<Vector3> NestRows::positions(const std::vector<std::size_t>& place, double u_m,
                                         const Eigen::VectorXd& c) const {
  std::vector<Matrix3> W(places(place), Matrix3::Zero());
  std::vector<Vector3> at(places(place), Vector3::Zero());
  const std::vector<Vector3> measured = measured_m(c);
  for (std::size_t v = 0; v < rows_.size(); ++v) {
    W[place[v]] += weight(v, u_m);
    at[place[v]] += weight(v, u_m) * measured[v];
  }
  for (std::size_t i = 0; i < at.size(); ++i) {
    at[i] = W[i].inverse() * at[i];
  }
  return at;
}

std::vector<double> NestRows::residuals(const std::vector<std::size_t>& place, double u_m,
                                        const Eigen::VectorXd& c) const {
  const std::vector<Vector3> measured = measured_m(c), at = positions(place, u_m, c);
  std::vector<double> sizes;
  for (std::size_t v = 0; v < rows_.size(); ++v) {
    const Vector3 r = measured[v] - at[place[v]];
    sizes.push_back(std::sqrt(r.dot(weight(v, u_m) * r)));
  }
  return sizes;
}

}  // namespace abbe::calib::otf
