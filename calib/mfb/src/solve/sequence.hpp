#pragma once
/// The steps of the sequence of [Viprey 2016], computed for values and derivatives together.

#include <array>
#include <vector>

#include "solve/sequential_roles.hpp"

namespace abbe::calib::mfb {

/// Values at the holes of a profile, one row per hole. The first column contains the values for the
/// observations, the other columns their derivatives by each coordinate of each profile. Every step
/// of the sequence is linear, so that the covariance of the result follows from the derivatives.
using HoleRows = Eigen::MatrixXd;

class Sequence {
 public:
  /// `o` must outlive the object.
  Sequence(const Observations& o, std::vector<Profile>, SequentialRoles);

  /// Computes all steps. NotApplicable: the bar does not cover the nodes of an axis.
  Result<void> run();
  /// First column: parameters of the model; other columns: their derivatives.
  [[nodiscard]] const Eigen::MatrixXd& U() const { return U_; }
  [[nodiscard]] const std::vector<Profile>& profiles() const { return profiles_; }

 private:
  using Delta = std::array<HoleRows, 3>;  ///< components x, y, z in machine axes

  /// Mean deviations of the passes of profile m in machine axes, with derivatives by the mean
  /// deviations in bar axes.
  [[nodiscard]] Delta in_machine_axes(std::size_t m, Eigen::Index first,
                                      Eigen::Index columns) const;
  /// Deviations of profile m without the effect of the errors found so far (delta = -V).
  [[nodiscard]] Delta without_known(std::size_t m) const;
  /// As without_known(), relative to the first row.
  [[nodiscard]] Delta from_first(std::size_t m) const;

  /// Coordinate of the tip along a machine axis at each hole.
  [[nodiscard]] Eigen::VectorXd tip(std::size_t m, Eigen::Index axis) const;
  /// The vector J of [Viprey 2016]: minus the tool offset.
  [[nodiscard]] Vector3 J(std::size_t m) const { return -profiles_[m].tool_m; }

  /// (Deviation of the second profile - that of the first) / difference_m, in one direction.
  [[nodiscard]] HoleRows slope(const ProfilePair&, std::size_t direction) const;
  /// The values minus the line through the first and the last value.
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
  /// Interpolates values at the nodes of an axis from those at the holes.
  [[nodiscard]] Result<HoleRows> at_nodes(Axis, const HoleRows& values, std::size_t m) const;
  /// Subtracts a constant or line from the rows of a table, so that they satisfy datum G2.
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
