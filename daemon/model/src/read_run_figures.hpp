#pragma once

#include <optional>

#include "abbe/model/model_document.hpp"
#include "model_reader.hpp"

namespace abbe::daemon {

/// Reads the figures of the run; nullopt in models of earlier versions.
[[nodiscard]] std::optional<RunFigures> read_run_figures(ModelReader& in);

}  // namespace abbe::daemon
