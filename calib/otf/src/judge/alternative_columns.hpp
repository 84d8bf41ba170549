#pragma once
/// The added columns of the alternatives with which a run is compared, and the texts of the
/// alternatives.

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/otf/judge/lack_of_fit.hpp"
#include "abbe/calib/otf/run/travel.hpp"
#include "solve/added_columns.hpp"

namespace abbe::calib::otf {

/// One alternative. `place`: for Cause::Moved and Cause::RangeStep the index of the first segment
/// after the motion or the beam break, for other causes the index of the vertex or of the leg.
struct Added {
  Cause cause;
  std::size_t place = 0;
};

class AlternativeColumns {
 public:
  using Values = std::array<double, AddedColumns::kMost>;
  using Family = std::vector<std::pair<Added, AddedColumns>>;

  explicit AlternativeColumns(const Observations&);

  /// Writes the values of the added columns in one row. Returns the number of columns; 0 if the
  /// alternative does not affect the row.
  std::size_t values(const Added&, const Observation&, Values&) const;
  /// Sums over all rows for every alternative, grouped by cause. O(rows).
  [[nodiscard]] std::vector<Family> sums(std::span<const double> residual_m) const;
  /// Text for an alternative, such as "the tracker or the machine moved by 52.1 um and 3.2 urad ...
  /// on leg 30". `d`: estimated coefficients of the columns.
  [[nodiscard]] std::string text(const Added&, const Eigen::VectorXd& d) const;

 private:
  /// Values in one row of the columns of a translation and of a rotation about the centre of the
  /// path.
  void rigid(const Observation&, Values&) const;
  [[nodiscard]] Family steps(std::span<const double> residual_m) const;
  [[nodiscard]] Family range_steps(std::span<const double> residual_m) const;

  const Observations& o_;
  Vector3 centre_m_ = Vector3::Zero();
  double last_segment_ = 1.0;
  std::vector<AxisTravel> direction_;  ///< direction of travel of each leg or position
};

}  // namespace abbe::calib::otf
