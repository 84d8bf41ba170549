#pragma once
/// For any method: an acquired run, and the model that is identified from it and judged by the
/// gate. Pure functions.

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

/// Adds when was measured to the conditions of the document, and the duration where the method did
/// not. `utc`: offset of the host clock of the run. Nothing is added for times that are not known.
void add_measured(ModelDocument& document, const ObservedTimes& times, protocol::UtcOffset utc);

}  // namespace abbe::daemon
