#pragma once
/// Prior for the smoothness of the error tables (Options::smoothness). The bend of a table at an
/// inner node, from its values U at three nodes x, is
///     b_i = h ((U_i+1 - U_i) / (x_i+1 - x_i) - (U_i - U_i-1) / (x_i - x_i-1)),
///     h = (x_i+1 - x_i-1) / 2
/// With equal distances it is the second difference U_i-1 - 2 U_i + U_i+1. The prior of each bend
/// is
///     b_i ~ N(0, (bend (h / 50 mm)^1.5)^2),   twice as large in rad for rotations
/// The exponent 1.5 is that of a function whose second derivative is white noise ([Wahba 1978]:
/// smoothing splines), so that the same `bend` means the same function for every distance of the
/// nodes. Constants and straight lines have no bend: the prior does not change them, and the datum
/// of the data (model_datum.hpp) remains free. Backlash and squareness have no such prior.
///
/// The prior rows belong to the adjustment, with the data: covariance, held-out test and test for
/// lack of fit contain them. The covariance is that of the estimate if the errors are as smooth as
/// stated. Where they are not, the prior would hide it. So each bend, and all bends of each table
/// together, are tested with their distribution under the prior and the noise of the data, and
/// where the test fails the prior is left out: there the data alone determine the table. Notes name
/// these places. The rows that are tested are those without the drift of the tracker and the offset
/// of the ranges that a fit with almost no prior shows (solve.hpp).
///
/// With the factor f of the variance of the data (Statistics::variance_factor) the rows of the
/// prior have the weight f, because the covariance is multiplied with f afterwards:
///     Cov = f (H + f P)^-1 = (H / f + P)^-1

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/estimation/information.hpp"
#include "abbe/calib/geometry/error_parameters.hpp"
#include "abbe/calib/geometry/table_basis.hpp"
#include "abbe/calib/otf/run/smoothness_options.hpp"

namespace abbe::calib::otf {

/// A bend to which the prior is not applied. With other nodes (lack_of_fit.hpp), neither is it to
/// bends whose middle node is between from_m and to_m, nor to those whose three nodes contain
/// position_m.
struct Bend {
  ErrorMotion motion;
  double position_m = 0.0;          ///< of the middle node
  double from_m = 0.0, to_m = 0.0;  ///< of the nodes beside it
  double value = 0.0;               ///< estimate with the prior, m or rad
  double times = 0.0;  ///< the estimate in units of its standard deviation under the prior
};

/// The prior of an adjustment.
struct Smoothness {
  std::array<double, 3> bend_m{};           ///< as SmoothnessOptions
  double variance_factor = 1.0;             ///< f above
  std::vector<Bend> sharp{};                ///< left out: single bends
  std::vector<ErrorMotion> rough_tables{};  ///< left out: all bends of a table
  std::size_t rows = 0;                     ///< bends with the prior
  /// Sum of the squares of their estimates over their prior variances, and its expected value.
  double chi2 = 0.0, expected_chi2 = 0.0;

  /// Number of single bends and tables that are left out.
  [[nodiscard]] std::size_t left_out() const { return sharp.size() + rough_tables.size(); }
};

/// With which an iteration begins: the widest prior, almost none. It hides no bend, and determines
/// what the data do not.
[[nodiscard]] Smoothness first_smoothness(const SmoothnessOptions&);

/// Adds the rows of the prior. The first unknowns of the information are those of the basis.
void add_smoothness(estimation::Information&, const TableBasis&, const Smoothness&);

/// The prior for these data (without it): what is left out.
/// `variance_factor`: f above.
[[nodiscard]] Smoothness smoothness_for(const estimation::Information& data, const TableBasis&,
                                        const SmoothnessOptions&, double variance_factor);
/// The prior for these data (without it), with the variance factor that results with this prior.
/// `first_factor`: that of an adjustment with first_smoothness(): where bends are sharp, a prior
/// increases the residuals, and a larger factor would permit it. `factor_with`: variance factor of
/// an adjustment with a prior; its last call is that with the returned one. Errors of
/// `factor_with`.
[[nodiscard]] Result<Smoothness> permitted_smoothness(
    const estimation::Information& data, const TableBasis&, const SmoothnessOptions&,
    double first_factor, const std::function<Result<double>(const Smoothness&)>& factor_with);
/// True if an adjustment with `b` would give the result of one with `a`, within 1 % of the size of
/// the prior.
[[nodiscard]] bool is_same(const Smoothness& a, const Smoothness& b);

/// "1.2 um" or "1 um (X), 1.5 um (Y), none (Z)".
[[nodiscard]] std::string size_text(const Smoothness&);
/// For the verdict: the prior, and where it is left out.
[[nodiscard]] std::vector<std::string> notes_on(const Smoothness&);

}  // namespace abbe::calib::otf
