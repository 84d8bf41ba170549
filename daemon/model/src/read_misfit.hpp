#pragma once

#include <optional>

#include "abbe/calib/model/misfit.hpp"
#include "model_reader.hpp"

namespace abbe::daemon {

/// The member `misfit` of model.json. nullopt in models without misfit and in models of earlier
/// versions.
[[nodiscard]] std::optional<calib::Misfit> read_misfit(ModelReader& in);

}  // namespace abbe::daemon
