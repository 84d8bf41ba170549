#pragma once
/// The unknowns that all positions of the bar share:
/// 1. the parameters of the model that datum G2 leaves free: the conditions K U = 0 of each table
///    express one of its nodes by the others (in general this node is zero),
/// 2. the error of the calibration of the bar, as g with dO = F g, F F^T = covariance, g ~ N(0, 1),
/// 3. the error of alpha, divided by its standard uncertainty, ~ N(0, 1),
/// 4. the error of the temperatures that is common to all positions, divided by its standard
///    uncertainty, ~ N(0, 1).

#include <Eigen/Core>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

using RowMajorRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class SharedUnknowns {
 public:
  explicit SharedUnknowns(const Observations&);

  [[nodiscard]] Eigen::Index size() const { return temperature_offset() + temperatures(); }
  /// Number of free parameters of the model; they come first.
  [[nodiscard]] Eigen::Index parameters() const { return parameters_; }
  [[nodiscard]] Eigen::Index bar_offset() const { return parameters_; }
  [[nodiscard]] Eigen::Index alpha_offset() const { return parameters_ + bar_root_.cols(); }
  [[nodiscard]] Eigen::Index alphas() const { return u_alpha_per_K_ > 0.0 ? 1 : 0; }
  [[nodiscard]] Eigen::Index temperature_offset() const { return alpha_offset() + alphas(); }
  [[nodiscard]] Eigen::Index temperatures() const { return growth_of_temperature_ > 0.0 ? 1 : 0; }
  /// Relative change of all lengths of the bar by one standard uncertainty of the common
  /// temperature.
  [[nodiscard]] double growth_of_temperature() const { return growth_of_temperature_; }
  [[nodiscard]] const Eigen::MatrixXd& bar_root() const { return bar_root_; }
  [[nodiscard]] double u_alpha_per_K() const { return u_alpha_per_K_; }

  /// Computes the columns of the free parameters from those of all parameters of the model.
  void reduce(const RowMajorRows& of_model, Eigen::Ref<RowMajorRows> free) const;
  /// The free parameters from a vector U of all parameters that satisfies the conditions.
  [[nodiscard]] Eigen::VectorXd free_of(const Eigen::VectorXd& U) const;
  /// Rows for all parameters of the model from the rows X of the free ones.
  [[nodiscard]] Eigen::MatrixXd expanded(const Eigen::MatrixXd& X) const;

 private:
  struct Term {
    Eigen::Index free = 0;
    double weight = 1.0;
  };

  std::vector<std::vector<Term>> of_parameter_;
  std::vector<bool> is_free_;
  Eigen::Index parameters_ = 0;
  Eigen::MatrixXd bar_root_;
  double u_alpha_per_K_ = 0.0, growth_of_temperature_ = 0.0;
};

}  // namespace abbe::calib::mfb
