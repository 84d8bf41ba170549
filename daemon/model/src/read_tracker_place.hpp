#pragma once

#include <cstddef>
#include <optional>

#include "abbe/calib/model/offset_in_model.hpp"
#include "model_reader.hpp"

namespace abbe::daemon {

/// The member `tracker_place` of model.json, with one derivative for each of `parameters`. nullopt
/// in models of runs without a named place, and in models of earlier versions.
[[nodiscard]] std::optional<calib::TrackerPlace> read_tracker_place(ModelReader& in,
                                                                    std::size_t parameters);

}  // namespace abbe::daemon
