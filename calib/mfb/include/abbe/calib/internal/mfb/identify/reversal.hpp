#pragma once
/// Calibration of a Multi-Feature Bar by reversal on a measuring machine [Viprey 2016, eq. 5 to 7]:
/// the bar is measured as it lies (normal) and turned by 180 degrees about its axis (reversed),
/// which changes the sign of its straightness errors but not that of the machine:
///     E_y = (M_y normal - M_y reversed) / 2,   E_y of the machine = -(M_y normal + M_y reversed) / 2
/// and the same in z. Positioning is not separable by reversal:
///     E_x = (M_x normal + M_x reversed) / 2 + E_XX of the machine
/// E_XX is measured on the line of the bar, with a step gauge. The sag of the bar cancels: the
/// result is the shape of the weightless bar.

#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::mfb {

/// Deviations M of the points of interest of one pass, one per hole, in the axes of the machine,
/// after end-point levelling; x without the nominal position, y without the nominal shift of the
/// hole, which has the opposite sign in a reversed pass. In m.
using BarPass = std::vector<Vector3>;

struct ReversalRuns {
  std::vector<BarPass> normal, reversed;  ///< one pass per repeat; the same number of both
  std::vector<double> machine_x_m;        ///< E_XX of the machine at each hole, on the bar's line
  std::vector<double> u_machine_x_m;  ///< standard uncertainty of machine_x_m; empty: not known,
                                      ///< counts as 0
};

struct CalibratedBar {
  std::vector<Vector3> error_m;        ///< E_x, E_y, E_z of each hole
  std::vector<Vector3> u_m;            ///< standard uncertainty of error_m; x contains the mean and
                                       ///< E_XX
  std::vector<Vector3> u_mean_m;       ///< standard uncertainty of the mean of the repeats alone
                                       ///< (type A)
  std::size_t degrees_of_freedom = 0;  ///< degrees of freedom of u_mean_m, for Student's t
  std::vector<Vector3> machine_m;      ///< errors of the machine along the bar; x: E_XX
};

/// Computes the shape of the bar. TooFewObservations below 2 repeats; BadInput below 2 holes, if
/// the numbers of repeats or holes differ, or an uncertainty is negative; NotFinite. The text names
/// pass and hole, counted from 1.
[[nodiscard]] Result<CalibratedBar> calibrate_by_reversal(const ReversalRuns&);

}  // namespace abbe::calib::mfb
