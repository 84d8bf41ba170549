#pragma once
/// The columns of the alternatives that a ball array's errors are compared with, and their words.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "abbe/calib/evemu/lack_of_fit.hpp"

namespace abbe::calib::evemu {

struct Added {
  Cause cause;
  std::size_t seen = 0;     ///< index of the position
  std::size_t feature = 0;  ///< index of the ball
};

/// Built when they are asked for, one alternative at a time: a run of N balls has N single ones of
/// 3 N x 3.
class AlternativeColumns {
 public:
  explicit AlternativeColumns(const Observations&);

  /// By cause. Empty for errors that were given without touches.
  [[nodiscard]] std::vector<std::vector<Added>> families() const;
  /// 3 rows.size() x k. Each unknown is a displacement of the ball farthest from Ball1 [m].
  [[nodiscard]] Eigen::MatrixXd of(const Added&) const;

 private:
  template <class Block>
  [[nodiscard]] Eigen::MatrixXd filled(Eigen::Index columns, const Block& block) const;
  [[nodiscard]] Eigen::MatrixXd of_balls(const Added&) const;
  [[nodiscard]] Eigen::MatrixXd of_step(const Added&) const;
  [[nodiscard]] Eigen::MatrixXd by_position(Cause) const;
  [[nodiscard]] Eigen::MatrixXd of_drift() const;

  const Observations& o_;
  double arm_m_ = 0.0;
};

/// ", position 3, ball 4" of an alternative that has a place.
[[nodiscard]] std::string where(const Added&, const Observations&);
/// d: of the columns [m].
[[nodiscard]] std::string text_of(const Added&, const Eigen::VectorXd& d_m, const Observations&);

}  // namespace abbe::calib::evemu
