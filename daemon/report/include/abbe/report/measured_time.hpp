#pragma once
/// The time at which a model was measured, for reports and page.

#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// The end of the measurement, or the time of the identification if the measurement has no date.
/// Reports order models by this time.
[[nodiscard]] protocol::UtcTime time_of(const ModelDocument& document);

}  // namespace abbe::daemon
