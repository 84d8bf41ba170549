#pragma once
/// Expanded uncertainty of the residuals of a verification that is caused by the noise of the
/// measured points.

#include <cstddef>

namespace abbe::calib::verify {

/// Expanded uncertainties for a coverage probability of 95 %, in m.
struct ResidualU {
  double rms_m = 0.0;  ///< for the root mean square of the residuals
  double max_m = 0.0;  ///< for the largest residual
};

/// `u_m`: standard uncertainty of each coordinate of a measured point; places >= 1. Correlations
/// are not known, so that the worst ones are assumed. Within a place: one cause displaces the three
/// coordinates together, |e| = sqrt(3) u |z| with z standard normal, e: error of the place. For the
/// rms: all places have the same error, so that more places do not reduce U. For the largest
/// residual: an error beyond U has the probability 0.05 / places at each place (Bonferroni).
[[nodiscard]] ResidualU expanded_uncertainty(double u_m, std::size_t places);

}  // namespace abbe::calib::verify
