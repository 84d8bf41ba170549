#pragma once
/// A model whose numbers are all different and not round, for tests of files and stores.

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon::test {

/// Deterministic from the seed, bit by bit. Nodes 150 mm apart in X and Y, 100 mm in Z, divided by
/// `finer`.
inline calib::VolumetricModel synthetic_model(unsigned seed, double finer = 1.0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto x = calib::equidistant_nodes(-0.3, 0.3, 0.15 / finer).value();
  const auto z = calib::equidistant_nodes(-0.4, -0.1, 0.1 / finer).value();
  const auto chain = calib::KinematicChain::parse("[w X' b Y Z (C1) t]").value();
  const auto layout = calib::ParameterLayout::observable_with_one_target(chain, {x, x, z}).value();
  const auto n = static_cast<Eigen::Index>(layout.model_size());
  Eigen::VectorXd U(n);
  Eigen::MatrixXd root(n, n);

  for (Eigen::Index i = 0; i < n; ++i) {
    U[i] = 1e-5 * normal(random);
    for (Eigen::Index j = 0; j < n; ++j) root(i, j) = 1e-8 * normal(random);
  }

  const Eigen::MatrixXd covariance = root * root.transpose();
  std::vector<calib::Vector3> corners;
  for (int i = 0; i < 8; ++i)
    corners.emplace_back((i & 1) != 0 ? 0.3 : -0.3, (i & 2) != 0 ? 0.3 : -0.3,
                         (i & 4) != 0 ? -0.1 : -0.4);
  const std::vector<calib::Vector3> tools{{0.02, -0.015, -0.12}};

  return calib::VolumetricModel::from_vector(layout, calib::ModelDatum::G1, tools, U,
                                             0.5 * (covariance + covariance.transpose()),
                                             calib::ValidityVolume::hull_of(corners).value())
      .value();
}

/// synthetic_model() with backlash: one difference per table, `D` [m or rad] in all of them, with
/// the standard uncertainty `u_D`.
inline calib::VolumetricModel synthetic_travel_model(unsigned seed, double D = 7e-6 / 3,
                                                     double u_D = 1e-7 * std::numbers::inv_sqrt3) {
  calib::ModelDescription d = synthetic_model(seed).description();
  const auto layout = calib::ParameterLayout::observable_with_one_target(d.chain, d.nodes).value();
  const auto kind = calib::TravelDependence::Backlash;
  const auto basis = calib::TableBasis::of(layout, {.travel = kind}).value();
  const auto n = static_cast<Eigen::Index>(layout.model_size()),
             m = static_cast<Eigen::Index>(basis.size()) - n;

  calib::TravelDifferences travel{kind, Eigen::VectorXd::Constant(m, D),
                                  u_D * u_D * Eigen::MatrixXd::Identity(m, m),
                                  Eigen::MatrixXd::Zero(n, m)};
  travel.cov_U_D(0, 0) = 1e-17 / 3;
  const Eigen::MatrixXd half = calib::half_differences(basis, travel.D);
  d.covariance += half * half.transpose();
  d.travel = std::move(travel);
  return calib::VolumetricModel::from_description(std::move(d)).value();
}

/// Accepted by the gate.
inline ModelDocument synthetic_document(unsigned seed) {
  ModelStatistics statistics{.samples = 1000,
                             .lost_samples = 3,
                             .observations = 200,
                             .unknowns = 90,
                             .rank = 70,
                             .condition = 1.0 / 3.0,
                             .sigma0 = 0.1,
                             .chi2_per_dof = 0.01,
                             .variance_factor = 4.0 / 3.0,
                             .before = {1e-5 / 3, 2e-5 / 3, 3e-5},
                             .after = {1e-7 / 3, 2e-7 / 3, 3e-7},
                             .iterations = 1,
                             .stop_reason = "direct"};

  ModelDocument document{synthetic_model(seed),
                         "otf",
                         "two-step",
                         "mill \"7\" \xC3\xBC",
                         "ab12",
                         protocol::UtcTime{std::chrono::nanoseconds{1'715'934'600'123'456'789}},
                         statistics,
                         {{"path.csv", "00ff"}, {"tracker.csv", "11ee"}}};
  document.verdict = ModelVerdict{.accepted = true};
  return document;
}

}  // namespace abbe::daemon::test
