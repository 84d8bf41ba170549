#pragma once

#include "abbe/calib/otf/solve/backlash.hpp"

namespace abbe::calib::otf {

/// Returns `data` with the priors of the observations added: backlash, smoothness. Unchanged
/// without both.
[[nodiscard]] inline estimation::Information with_priors(estimation::Information data,
                                                         const Observations& o) {
  data = with_backlash_prior(std::move(data), o);
  if (o.smoothness) {
    add_smoothness(data, o.basis, *o.smoothness);
  }
  return data;
}

/// Number of combinations that the data determine: trace(Q A^T W^2 A), rounded. `data`: information
/// without the priors that Q contains.
[[nodiscard]] std::size_t determined_by(const estimation::Information& data,
                                        const Eigen::MatrixXd& Q);

}  // namespace abbe::calib::otf
