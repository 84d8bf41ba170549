#pragma once
/// Functions for the acquired run of any method: they identify a model from the run, and the gate
/// judges the model. Pure functions.

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/methods/methods.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

using CalibrationRun = Methods::Run;
using Candidate = Methods::Candidate;

/// Identifies a model from the run. The gate judges the model and compares it with `active`, the
/// active model, which is null if there is none.
[[nodiscard]] Result<Candidate> identify(const CalibrationRun& run, const Config& config,
                                         const calib::VolumetricModel* active,
                                         const IdentificationWatch& watch = {});

/// Inputs of the run, as listed in the model document: the given files, and "points" or "touches"
/// with the SHA-256 of the data used in the identification.
[[nodiscard]] std::vector<InputFile> inputs_of(const CalibrationRun& run);

[[nodiscard]] std::string_view method_of(const Candidate& candidate) noexcept;  ///< "otf", "evemu"
[[nodiscard]] const calib::Verdict& verdict_of(const Candidate& candidate);
[[nodiscard]] ModelDocument document_of(const Candidate& candidate, const Config& config,
                                        std::vector<InputFile> inputs, protocol::UtcTime created);

/// Host times of the first and the last observation of a run.
using ObservedTimes = std::optional<std::array<protocol::HostTime, 2>>;
[[nodiscard]] ObservedTimes observed(const CalibrationRun& run);

/// Adds the time of the measurement to the conditions of the document, and the duration if the
/// method has not set it. `utc`: offset of the host clock of the run. Times that are not known add
/// nothing.
void add_measured(ModelDocument& document, const ObservedTimes& times, protocol::UtcOffset utc);

}  // namespace abbe::daemon
