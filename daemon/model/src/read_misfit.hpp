#pragma once

#include <optional>

#include "abbe/calib/model/misfit.hpp"
#include "model_reader.hpp"

namespace abbe::daemon {

/// The member `misfit` of model.json; nullopt in models without misfit, which those of earlier
/// versions are.
[[nodiscard]] std::optional<calib::Misfit> read_misfit(ModelReader& in);

}  // namespace abbe::daemon
