#pragma once
/// How much the noise of the measured points may have changed the residuals of a verification.

#include <cstddef>

namespace abbe::calib::verify {

/// Expanded uncertainties for a coverage probability of 95 %, in m.
struct ResidualU {
  double rms_m = 0.0;  ///< of the root mean square of the residuals
  double max_m = 0.0;  ///< of the largest residual
};

/// `u_m`: standard uncertainty of each coordinate of a measured point; places >= 1.
/// Nothing is known of correlations, so that the worst are taken. One cause may move the three
/// coordinates of a place together: its error e has |e| = sqrt(3) u |z| with z standard normal.
/// rms: the same error at all places, so that more places do not make U smaller. Largest: no place
/// has an error beyond U; each of them has one with probability 0.05 / places (Bonferroni).
[[nodiscard]] ResidualU expanded_uncertainty(double u_m, std::size_t places);

}  // namespace abbe::calib::verify
