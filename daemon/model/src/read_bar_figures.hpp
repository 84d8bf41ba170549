#pragma once

#include <optional>

#include "abbe/model/model_document.hpp"
#include "model_reader.hpp"

namespace abbe::daemon {

/// The members of "statistics" that models of method mfb have; nullopt for other methods.
[[nodiscard]] std::optional<BarFigures> read_bar_figures(ModelReader& in);

}  // namespace abbe::daemon
