#pragma once
/// Finds the misfit of a ball array (abbe/calib/model/misfit.hpp) from the scatter of the ball
/// centres.

#include <optional>

#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/calib/evemu/solve/solve.hpp"
#include "abbe/calib/model/misfit.hpp"

namespace abbe::calib::evemu {

/// Scatter of the ball centres about the model that is not explained by touches and array:
///     u_V^2 = s^2 - s_centre^2 - u_array^2
/// s: noise of a ball centre per coordinate (Statistics::s_m), s_centre: noise that follows from
/// the residuals of the touches to their balls, u_array: rms of the standard uncertainties of the
/// balls' places in the array. Possible reasons are errors that polynomials of low degree cannot
/// represent (pitch of a screw, shape of a guideway), an array that is not rigid, and slow noise;
/// touches cannot distinguish them. nullopt if the excess may be due to chance, or without touches.
[[nodiscard]] std::optional<Misfit> find_misfit(const Observations&, const VolumetricModel&,
                                                const Statistics&);

}  // namespace abbe::calib::evemu
