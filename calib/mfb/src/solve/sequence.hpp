#pragma once
/// The steps of the sequence of [Viprey 2016], on values and derivatives at once.

#include <array>
#include <vector>

#include "solve/sequential_roles.hpp"

namespace abbe::calib::mfb {

/// Values at the holes of a profile, one row per hole. The first column is that of the
/// observations, the others their derivatives by each coordinate of each profile: every step of the
/// sequence is linear, so that the covariance of the result follows from the last columns.
using HoleRows = Eigen::MatrixXd;

class Sequence {
 public:
  /// `o` must outlive the object.
  Sequence(const Observations& o, std::vector<Profile>, SequentialRoles);

  /// NotApplicable: the bar does not cover the nodes of an axis.
  Result<void> run();
  /// Parameters of the model: first column, and their derivatives.
  [[nodiscard]] const Eigen::MatrixXd& U() const { return U_; }
  [[nodiscard]] const std::vector<Profile>& profiles() const { return profiles_; }

 private:
  using Delta = std::array<HoleRows, 3>;  ///< x, y, z of the machine

  /// Mean of the passes; derivatives by the mean deviations in bar axes.
  [[nodiscard]] Delta in_machine_axes(std::size_t m, Eigen::Index first,
                                      Eigen::Index columns) const;
  /// The deviations without the effect of the errors found so far: delta = -V.
  [[nodiscard]] Delta without_known(std::size_t m) const;
  /// The same minus the first row.
  [[nodiscard]] Delta from_first(std::size_t m) const;

  /// Coordinate of the tip at each hole.
  [[nodiscard]] Eigen::VectorXd tip(std::size_t m, Eigen::Index axis) const;
  /// J of the paper.
  [[nodiscard]] Vector3 J(std::size_t m) const { return -profiles_[m].tool_m; }

  /// (D of the second - D of the first) / difference, in one direction.
  [[nodiscard]] HoleRows slope(const ProfilePair&, std::size_t direction) const;
  /// Minus the line through the first and the last value.
  [[nodiscard]] HoleRows detrended(HoleRows, std::size_t m, Eigen::Index axis) const;
  /// Mean of `value` over all profiles along an axis.
  template <class Value>
  [[nodiscard]] HoleRows mean_along(std::size_t axis, const Value& value) const {
    HoleRows sum = HoleRows::Zero(std::ssize(o_.bar.O_m), U_.cols());
    for (const std::size_t m : roles_.along[axis]) {
      sum += value(m, from_first(m)) / static_cast<double>(roles_.along[axis].size());
    }
    return sum;
  }

  /// Sets a table from its values at the holes of profile m, in datum G2.
  Result<void> set(ErrorMotion, const HoleRows& values, std::size_t m);
  /// Values at the nodes of an axis from those at the holes.
  [[nodiscard]] Result<HoleRows> at_nodes(Axis, const HoleRows& values, std::size_t m) const;
  /// Subtracts what datum G2 requires from the rows of a table.
  void impose_datum(ErrorMotion, Eigen::Ref<Eigen::MatrixXd> rows) const;
  Result<void> x_stage();
  Result<void> y_stage();
  Result<void> z_stage();
  void squareness_stage();
  /// Slope of the deviation along the bar against the place along the bar.
  [[nodiscard]] Eigen::RowVectorXd slope_along_bar(std::size_t m) const;

  const Observations& o_;
  std::vector<Profile> profiles_;
  SequentialRoles roles_;
  std::vector<Delta> delta_;
  Eigen::MatrixXd U_;
  std::vector<bool> known_;
};

}  // namespace abbe::calib::mfb
