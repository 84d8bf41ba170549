#pragma once

#include <optional>

#include "abbe/model/model_document.hpp"
#include "model_reader.hpp"

namespace abbe::daemon {

/// Absent in models of earlier versions.
[[nodiscard]] std::optional<RunFigures> read_run_figures(ModelReader& in);

}  // namespace abbe::daemon
