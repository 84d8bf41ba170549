#pragma once
/// The adjustment of two parts i and j in the coordinates e of the datum (joint/identify.hpp).

#include <Eigen/Core>
#include <string>
#include <vector>

#include "abbe/calib/internal/joint/determining_rows.hpp"
#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/joint/identify.hpp"

namespace abbe::calib::joint {

/// The statistic X2 of two parts (joint/identify.hpp), with its degrees of freedom and log of its
/// probability.
struct Disagreement {
  double statistic = 0.0, log_p = 0.0;
  std::size_t dof = 0;
};

class PairProblem {
 public:
  PairProblem(const Part& i, const Part& j, const DatumCoordinates&);

  [[nodiscard]] const DeterminingRows& of_i() const { return i_; }
  [[nodiscard]] const DeterminingRows& of_j() const { return j_; }
  /// Rows for other information about a part (a hypothesis), in the unknowns of this problem.
  [[nodiscard]] DeterminingRows rows(const Part&, const estimation::Information&) const;
  [[nodiscard]] Disagreement disagreement() const { return disagreement(i_, j_); }
  [[nodiscard]] Disagreement disagreement(const DeterminingRows& i, const DeterminingRows& j) const;

  /// Minimum sum of squares of both parts together, including DeterminingRows::rest of each part.
  /// It is -2 times the logarithm of the likelihood, except for a constant.
  [[nodiscard]] double squares(const DeterminingRows& i, const DeterminingRows& j) const;

  /// Result of the adjustment if part j observes e + `free` d, d being additional unknowns.
  struct Freed {
    Disagreement left;
    double drop = 0.0;         ///< decrease of X2
    std::size_t drop_dof = 0;  ///< number of combinations of d that the parts determine
    Eigen::VectorXd d;
    Eigen::MatrixXd root_cov_d;  ///< covariance of d = root root^T
  };
  [[nodiscard]] Freed freed(const Eigen::MatrixXd& free) const;

 private:
  struct Minimum {
    estimation::Information sum;
    std::size_t rank = 0;
  };
  [[nodiscard]] Minimum minimum(const DeterminingRows& i, const DeterminingRows& j,
                                const Eigen::MatrixXd& free) const;
  [[nodiscard]] Disagreement tested(const Minimum&, std::size_t rows) const;

  const Eigen::MatrixXd& N_;
  std::vector<std::string> shared_;
  DeterminingRows i_, j_;
  double noise_factor_ = 1.0;
};

}  // namespace abbe::calib::joint
