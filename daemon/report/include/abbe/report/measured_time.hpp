#pragma once
/// When a model was measured, for reports and page.

#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// The end of the measurement, else the time of the identification. Models are ordered by it.
[[nodiscard]] protocol::UtcTime time_of(const ModelDocument& document);

}  // namespace abbe::daemon
