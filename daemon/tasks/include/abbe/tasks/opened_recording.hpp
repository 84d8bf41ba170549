#pragma once
/// A recording, and the configuration with which it is replayed.

#include <functional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/config/config.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

struct OpenedRecording {
  RecordingReader reader;
  Config config;
  InputFile source;
};

/// Opens `file`. The configuration is read from the file `config`; if `config` is empty, it is the
/// recorded one. `stopped` as for RecordingReader::open().
[[nodiscard]] Result<OpenedRecording> open_recording(const std::string& file,
                                                     const std::string& config = {},
                                                     const std::function<bool()>& stopped = {});

/// Sets in `config` the meaning of the readings, and whether devices are simulated, from the
/// recorded configuration. This is necessary because the samples of a recording have the meaning
/// that the recorded configuration gives them. null: the recorded configuration cannot be read.
void take_recorded_readings(Config& config, const Config* recorded);

}  // namespace abbe::daemon
