#include "abbe/calib/internal/mfb/solve/shared_unknowns.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "abbe/calib/model/model_datum.hpp"

namespace abbe::calib::mfb {
namespace {

/// F with F F^T = C and as many columns as C has rank; eigenvalues below 1e-12 of the largest count
/// as zero.
Eigen::MatrixXd root_of_covariance(const Eigen::MatrixXd& C) {
  constexpr double kZero = 1e-12;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(C);
  const Eigen::VectorXd& values = eigen.eigenvalues();  // in ascending order
  const double least = kZero * std::max(values(values.size() - 1), 0.0);
  const Eigen::Index kept = (values.array() > least).count();
  return eigen.eigenvectors().rightCols(kept) * values.tail(kept).cwiseSqrt().asDiagonal();
}

}  // namespace

SharedUnknowns::SharedUnknowns(const Observations& o)
    : of_parameter_(o.basis.size()),
      is_free_(o.basis.size(), false),
      bar_root_(root_of_covariance(o.bar.covariance_m2)),
      u_alpha_per_K_(o.bar.expansion ? o.bar.expansion->u_alpha_per_K : 0.0),
      growth_of_temperature_(o.bar.expansion ? std::abs(o.bar.expansion->alpha_per_K) *
                                                   o.plan.noise.common_temperature_K()
                                             : 0.0) {
  const Eigen::MatrixXd K = datum_conditions(ModelDatum::G2, o.basis, o.basis.size());
  std::vector<Eigen::Index> condition_of(o.basis.size(), -1);
  for (Eigen::Index row = 0; row < K.rows(); ++row) {
    Eigen::Index pivot = 0;
    K.row(row).cwiseAbs().maxCoeff(&pivot);
    condition_of[static_cast<std::size_t>(pivot)] = row;
  }

  std::vector<Eigen::Index> free_of(o.basis.size(), -1);
  for (std::size_t p = 0; p < free_of.size(); ++p) {
    if (condition_of[p] < 0) {
      free_of[p] = parameters_++;
      of_parameter_[p].push_back({free_of[p], 1.0});
      is_free_[p] = true;
    }
  }
  for (std::size_t p = 0; p < free_of.size(); ++p) {
    for (std::size_t i = 0; condition_of[p] >= 0 && i < free_of.size(); ++i) {
      const double k = K(condition_of[p], static_cast<Eigen::Index>(i));
      if (k != 0.0 && free_of[i] >= 0) {
        of_parameter_[p].push_back(
            {free_of[i], -k / K(condition_of[p], static_cast<Eigen::Index>(p))});
      }
    }
  }
}

void SharedUnknowns::reduce(const RowMajorRows& of_model, Eigen::Ref<RowMajorRows> free) const {
  free.setZero();
  for (Eigen::Index row = 0; row < of_model.rows(); ++row) {
    for (std::size_t p = 0; p < of_parameter_.size(); ++p) {
      for (const Term& term : of_parameter_[p]) {
        free(row, term.free) += term.weight * of_model(row, static_cast<Eigen::Index>(p));
      }
    }
  }
}

Eigen::VectorXd SharedUnknowns::free_of(const Eigen::VectorXd& U) const {
  Eigen::VectorXd free(parameters_);
  for (std::size_t p = 0; p < of_parameter_.size(); ++p) {
    if (is_free_[p]) {
      free(of_parameter_[p].front().free) = U(static_cast<Eigen::Index>(p));
    }
  }
  return free;
}

Eigen::MatrixXd SharedUnknowns::expanded(const Eigen::MatrixXd& X) const {
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(std::ssize(of_parameter_), X.cols());
  for (std::size_t p = 0; p < of_parameter_.size(); ++p) {
    for (const Term& term : of_parameter_[p]) {
      all.row(static_cast<Eigen::Index>(p)) += term.weight * X.row(term.free);
    }
  }
  return all;
}

}  // namespace abbe::calib::mfb
