#pragma once
/// The columns of the alternatives that a run is held against, and their words.

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/otf/lack_of_fit.hpp"
#include "otf/added_columns.hpp"

namespace abbe::calib::otf {

/// One alternative: its cause, and where: the first block after the step, vertex or leg.
struct Added {
  Cause cause;
  std::size_t place = 0;
};

class AlternativeColumns {
 public:
  using Values = std::array<double, AddedColumns::kMost>;
  using Family = std::vector<std::pair<Added, AddedColumns>>;

  explicit AlternativeColumns(const Observations&);

  /// Of one row; returns how many columns there are, 0 where the row has none of it.
  std::size_t values(const Added&, const Observation&, Values&) const;
  /// Over all rows, by cause. O(rows).
  [[nodiscard]] std::vector<Family> sums(std::span<const double> residual_m) const;
  /// "the tracker or the machine moved by 52.1 um and 3.2 urad ... on leg 30": `d` of the columns.
  [[nodiscard]] std::string text(const Added&, const Eigen::VectorXd& d) const;

 private:
  /// Translation and rotation about the centre of the path.
  void rigid(const Observation&, Values&) const;
  [[nodiscard]] Family steps(std::span<const double> residual_m) const;

  const Observations& o_;
  Vector3 centre_m_ = Vector3::Zero();
  double last_block_ = 1.0;
  std::vector<std::array<int, 3>> direction_;  ///< of each leg and axis: sign of the last motion
};

}  // namespace abbe::calib::otf
