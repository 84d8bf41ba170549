#pragma once
/// Prior for the smoothness of the error tables (Options::smoothness). The bend of a table at an
/// inner node, from its values U at three nodes x, is
///     b_i = h ((U_i+1 - U_i) / (x_i+1 - x_i) - (U_i - U_i-1) / (x_i - x_i-1)),
///     h = (x_i+1 - x_i-1) / 2
/// With equal distances it is the second difference U_i-1 - 2 U_i + U_i+1. The prior of each bend
/// is
///     b_i ~ N(0, (bend (h / 50 mm)^1.5)^2),   twice as large in rad for rotations
/// The exponent 1.5 holds for a function whose second derivative is white noise ([Wahba 1978]:
/// smoothing splines). The same `bend` then describes the same function for every distance of the
/// nodes. Constants and straight lines have no bend: the prior does not change them, and the datum
/// (model_datum.hpp) remains free. Backlash and squareness have no such prior.
///
/// The prior rows belong to the adjustment, with the data: covariance, held-out test and test for
/// lack of fit contain them. The covariance is correct if the errors are as smooth as stated. If
/// they are less smooth, the prior would hide this. Therefore each bend, and all bends of each
/// table together, are tested: they must be probable under the prior and the noise of the data. If
/// a test fails, the prior is left out for these bends, and the data alone determine the table
/// there. Notes name these places. Before the tests, the drift of the tracker and the offset of the
/// ranges are subtracted from the rows, as estimated by a fit with almost no prior (solve.hpp).
///
/// The rows of the prior have the weight f, the factor of the variance of the data
/// (Statistics::variance_factor), because the covariance is afterwards multiplied by f:
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

/// A bend to which the prior is not applied. In a fit with other nodes (lack_of_fit.hpp) the prior
/// is not applied to bends whose middle node is between from_m and to_m, nor to bends whose three
/// nodes enclose position_m.
struct Bend {
  ErrorMotion motion;
  double position_m = 0.0;          ///< position of the middle node
  double from_m = 0.0, to_m = 0.0;  ///< positions of the nodes beside it
  double value = 0.0;               ///< estimate with the prior, m or rad
  double times = 0.0;  ///< the estimate in units of its standard deviation under the prior
};

/// The prior of an adjustment, and the bends to which it is not applied.
struct Smoothness {
  std::array<double, 3> bend_m{};           ///< as SmoothnessOptions::bend_m
  double variance_factor = 1.0;             ///< the factor f of this header
  std::vector<Bend> sharp{};                ///< single bends that are left out
  std::vector<ErrorMotion> rough_tables{};  ///< tables whose bends are all left out
  std::size_t rows = 0;                     ///< number of bends with the prior
  /// For the bends with the prior: sum of (estimate^2 / prior variance), and its expected value.
  double chi2 = 0.0, expected_chi2 = 0.0;

  /// Number of single bends and tables that are left out.
  [[nodiscard]] std::size_t left_out() const { return sharp.size() + rough_tables.size(); }
};

/// The prior for the start of an iteration: the widest one, which has almost no effect. It hides no
/// bend, and makes unknowns determined that the data do not determine.
[[nodiscard]] Smoothness first_smoothness(const SmoothnessOptions&);

/// Adds the rows of the prior. The first unknowns of the information are those of the basis.
void add_smoothness(estimation::Information&, const TableBasis&, const Smoothness&);

/// Tests the bends with these data (without prior) and returns the prior with the bends that are
/// left out. `variance_factor`: f of this header.
[[nodiscard]] Smoothness smoothness_for(const estimation::Information& data, const TableBasis&,
                                        const SmoothnessOptions&, double variance_factor);
/// As smoothness_for(), with the variance factor that results with this prior. `first_factor`:
/// variance factor of an adjustment with first_smoothness(). It is needed because a prior increases
/// the residuals where bends are sharp, and a larger factor would then permit this prior.
/// `factor_with`: computes the variance factor of an adjustment with a prior; it is last called
/// with the returned prior. Errors of `factor_with`.
[[nodiscard]] Result<Smoothness> permitted_smoothness(
    const estimation::Information& data, const TableBasis&, const SmoothnessOptions&,
    double first_factor, const std::function<Result<double>(const Smoothness&)>& factor_with);
/// True if an adjustment with `b` would give the result of one with `a`, within 1 % of the size of
/// the prior.
[[nodiscard]] bool is_same(const Smoothness& a, const Smoothness& b);

/// Text such as "1.2 um" or "1 um (X), 1.5 um (Y), none (Z)".
[[nodiscard]] std::string size_text(const Smoothness&);
/// Notes for the verdict: the prior, and the places where it is left out.
[[nodiscard]] std::vector<std::string> notes_on(const Smoothness&);

}  // namespace abbe::calib::otf
