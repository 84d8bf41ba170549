#pragma once

#include "abbe/calib/estimation/datum.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// The conditions of datum G2 (model_datum.hpp) as a Datum for the unknowns of the observations.
[[nodiscard]] estimation::Datum datum_of(const Observations&);

}  // namespace abbe::calib::otf
