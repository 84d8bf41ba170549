#pragma once
/// Misfit of a ball array (abbe/calib/model/misfit.hpp), found from the scatter of the ball
/// centres.

#include <optional>

#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/calib/evemu/solve/solve.hpp"
#include "abbe/calib/model/misfit.hpp"

namespace abbe::calib::evemu {

/// Scatter of the ball centres about the model beyond what explains it:
///     u_V^2 = s^2 - s_centre^2 - u_array^2
/// s: noise of a ball centre per coordinate (Statistics::s_m), s_centre: noise that follows from
/// the residuals of the touches to their balls, u_array: rms of the standard uncertainties of the
/// balls' places in the array. Polynomials of low degree follow neither the pitch of a screw nor
/// the shape of a guideway; touches do not tell it from an array that is not rigid or from slow
/// noise. nullopt if chance explains the excess, or without touches.
[[nodiscard]] std::optional<Misfit> find_misfit(const Observations&, const VolumetricModel&,
                                                const Statistics&);

}  // namespace abbe::calib::evemu
