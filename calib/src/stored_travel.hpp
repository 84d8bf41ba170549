#pragma once

#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib {

/// The model with ModelDescription::travel. BadInput, too, if the covariance of tables and
/// differences together is not positive semidefinite.
[[nodiscard]] Result<VolumetricModel> with_stored_travel(VolumetricModel, const ModelDescription&);

}  // namespace abbe::calib
