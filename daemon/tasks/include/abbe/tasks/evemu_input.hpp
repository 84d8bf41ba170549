#pragma once
/// The measured data of a ball array: touches with their calibrator, errors that another
/// program computed, or the last complete run of a recording. Converts them to observations.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/calibration_run.hpp"
#include "abbe/methods/evemu/acquisition.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// The options that name the data. An empty name means that the file is not given.
struct EvemuInputArguments {
  std::string machine, touches, calibrator, errors, recording, rotation_reference;
  std::optional<int> order, positions;             ///< default: the value of [evemu]
  std::optional<double> artefact_C, u_artefact_K;  ///< both or none
  std::optional<double> u_reference_um{};          ///< required with rotation_reference
  bool rotation_known = false, scales_corrected = false;
  std::optional<calib::Vector3> tip_offset_m{};  ///< default: [target] offset_mm
};

/// The measured data, from files or from a recording.
struct EvemuInput {
  Config config;
  std::vector<InputFile> sources;
  calib::evemu::Observations observations;
  std::optional<RotationPoints> rotation_reference;
  /// refuses the model if the recording is damaged
  std::function<void(calib::Verdict&)> judge_source = [](calib::Verdict&) {};
  std::string recording_gap{};
  ObservedTimes observed{};   ///< times of the recording; nullopt for files
  protocol::UtcOffset utc{};  ///< offset of the host clock of the recording
};

/// Reads the data from the recording if one is named, else from the files. Errors: Io; BadInput
/// with file and line; DataInsufficient if the recording has no complete run.
[[nodiscard]] Result<EvemuInput> read_evemu_input(const EvemuInputArguments&, const Progress&);

/// Adds the points of the file `rotation_reference` to the input. Does nothing if none is named.
[[nodiscard]] Result<void> read_rotation_reference(const EvemuInputArguments&, EvemuInput&);

/// A message if the configuration gives the artefact's temperature by a sensor, but the input is a
/// file of touches, which has no sensor values. Empty otherwise.
[[nodiscard]] std::string missing_array_sensor(const EvemuInputArguments&, const Config&);

}  // namespace abbe::daemon
