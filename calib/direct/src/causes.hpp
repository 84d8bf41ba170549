#pragma once
/// Why a directly measured error does not fit a model: mistakes that people make with such files.

#include <span>
#include <string>
#include <vector>

#include "abbe/calib/direct/compare.hpp"
#include "abbe/calib/internal/direct/judge.hpp"
#include "abbe/calib/internal/direct/scatter.hpp"
#include "model_curve.hpp"

namespace abbe::calib::direct {

/// What the test of corrected values needs.
struct CauseTest {
  Scatter scatter;
  std::size_t runs = 0;
  DeviceUncertainty device{};
  Limits limits{};
};

/// The corrections of the measured values with which they are closer to the model: the rms
/// difference is at most a third of that of the given values, and at most 1.5 times that of the
/// best correction. Degrees of freedom: positions without the conditions of the convention and
/// without the parameters of the correction. They begin with "fits" if no corrected value exceeds
/// its limit, else with "closer"; also without a test. Empty if nothing helps, or with fewer than 3
/// degrees of freedom. A correction with as many parameters as the model has nodes in the range,
/// without those conditions, would fit anything and is not tried.
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
