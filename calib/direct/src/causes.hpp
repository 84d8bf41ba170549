#pragma once
/// Finds why a directly measured error does not fit a model: typical mistakes in files of measured
/// values.

#include <span>
#include <string>
#include <vector>

#include "abbe/calib/direct/compare.hpp"
#include "abbe/calib/internal/direct/judge.hpp"
#include "abbe/calib/internal/direct/scatter.hpp"
#include "model_curve.hpp"

namespace abbe::calib::direct {

/// Quantities for the test of corrected values.
struct CauseTest {
  Scatter scatter;
  std::size_t runs = 0;
  DeviceUncertainty device{};
  Limits limits{};
};

/// Returns the corrections of the measured values that bring them closer to the model: the rms
/// difference is at most a third of that of the given values, and at most 1.5 times that of the
/// best correction. The degrees of freedom of an rms are the number of positions, less the
/// conditions of the convention, less the parameters of the correction. A text begins with "fits"
/// if a CauseTest is given and no corrected value exceeds its limit, else with "closer". The result
/// is empty if no correction helps, or with fewer than 3 degrees of freedom. A correction must have
/// fewer parameters than the model has nodes in the range, less the conditions of the convention;
/// otherwise it would fit any values and is not tried.
///
/// Tried: the sign; the positions reversed or counted from the other end, with either sign; a
/// factor (unit); a slope of a positioning error (temperature, wavelength, scales); an offset of
/// the positions; an offset of the measured line, which adds rotations times levers (Abbe).
[[nodiscard]] std::vector<std::string> likely_causes(const ModelCurve&,
                                                     std::span<const double> positions_m,
                                                     const Eigen::VectorXd& measured,
                                                     StraightnessLine,
                                                     const std::optional<CauseTest>&);

}  // namespace abbe::calib::direct
