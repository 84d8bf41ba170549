#include "otf/nest_information.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "elementary.hpp"

namespace abbe::calib::otf {
namespace {

/// Prior standard deviation of the position of a nest; its value changes only how readily a nest is
/// taken to have moved.
constexpr double kPosition_m = 1e-3;

std::size_t places(const std::vector<std::size_t>& place) {
  return place.empty() ? 0 : *std::max_element(place.begin(), place.end()) + 1;
}

}  // namespace

NestRows::NestRows(const DriftObservations& d, const DriftBasis& basis) : size_(basis.size()) {
  std::map<std::size_t, Vector3> first;
  for (const NestVisit& visit : d.visits) {
    const Vector3 origin = first.emplace(visit.nest, visit.mean_tracker_m).first->second;
    rows_.push_back({basis.dp_dc(visit.time_s, visit.mean_tracker_m), visit.mean_tracker_m - origin,
                     visit.cov_tracker_m2});
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
        WH += wH;
        all.N += row.H.transpose() * wH;
        all.Nc += wH.transpose() * row.z_m;
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
    all.emplace_back(row.z_m - row.H * c);
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
