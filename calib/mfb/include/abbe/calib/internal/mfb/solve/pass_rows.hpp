#pragma once
/// The rows of one pass: derivatives of its deviations delta (observe.hpp) by the shared unknowns
/// and by those of its position. Unknowns of a position, in bar axes:
/// 0 to 2: displacement of the bar [m], 3 to 5: rotation about the middle of the bar [rad],
/// then for each further tool its 3 constants [m],
/// then for each pair 3 rates of drift and 3 constants of the second pass [m],
/// then, only for the search of a cause, 3 rates of every pass without a pair [m],
/// then the error of the temperature [K].

#include <vector>

#include "abbe/calib/internal/mfb/solve/shared_unknowns.hpp"

namespace abbe::calib::mfb {

inline constexpr Eigen::Index kRollUnknown = 3;

struct NuisanceLayout {
  /// index of the first unknown of each kind
  Eigen::Index tools = 6, pairs = 6, rates = 6, temperature = 6;
  Eigen::Index size = 6;
  /// Standard uncertainty of the prior of each unknown; kNoPrior: no prior.
  std::vector<double> u;

  [[nodiscard]] bool has_temperature() const { return size > temperature; }
};

struct NuisanceOptions {
  double u_roll_rad = 100e-6;
  bool drift = true;                    ///< pairs have unknown rates of drift
  double u_rate_of_every_pass_m = 0.0;  ///< prior of the rates of passes without a pair; 0: these
                                        ///< passes have no drift
};
[[nodiscard]] NuisanceLayout nuisance_layout(const Observations&, std::size_t position,
                                             const NuisanceOptions&);

/// The passes of a position, as indices in Observations::passes.
[[nodiscard]] std::vector<std::size_t> passes_of(const Observations&, std::size_t position);

/// Matrix with 3N rows; columns: free parameters, bar, alpha and temperature (SharedUnknowns).
[[nodiscard]] RowMajorRows shared_rows(const Observations&, const PassObservation&,
                                       const SharedUnknowns&);
/// Matrix with 3N rows; columns: unknowns of the position. `number`: index of the pass in its
/// position.
[[nodiscard]] Eigen::MatrixXd nuisance_rows(const Observations&, const PassObservation&,
                                            std::size_t number, const NuisanceLayout&,
                                            const NuisanceOptions&);

}  // namespace abbe::calib::mfb
