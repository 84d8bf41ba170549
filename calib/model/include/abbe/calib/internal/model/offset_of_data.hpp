#pragma once

#include <cmath>
#include <optional>

#include "abbe/calib/model/offset_in_model.hpp"

namespace abbe::calib {

/// Estimate of the range offset of a run from its data alone, without the prior.
struct OffsetOfData {
  double value_m = 0.0, u_m = 0.0;
};
/// Removes the prior from the estimate `o`. The estimate with the prior satisfies
///     1/u^2 = s^2 + 1/u_prior^2,   d = s^2 d_data u^2,   s = 1 / (standard uncertainty of d_data)
/// Returns nullopt if the data contain no information about the offset.
inline std::optional<OffsetOfData> of_data(const OffsetInModel& o) {
  constexpr double kNothing = 1e-9;  // rounding of 1 - u^2 / u_prior^2
  const double u2 = o.u_m * o.u_m, s2 = 1.0 / u2 - 1.0 / (o.u_prior_m * o.u_prior_m);
  if (!(s2 * u2 > kNothing)) {
    return std::nullopt;
  }
  return OffsetOfData{o.value_m / (u2 * s2), 1.0 / std::sqrt(s2)};
}

}  // namespace abbe::calib
