#pragma once
/// A recording, and the configuration to go through it with.

#include <string>

#include "abbe/daemon/config.hpp"
#include "abbe/daemon/error.hpp"
#include "abbe/daemon/input_files.hpp"
#include "abbe/daemon/recording_reader.hpp"

namespace abbe::daemon {

struct OpenedRecording {
  RecordingReader reader;
  Config config;
  InputFile source;
};

/// The configuration is that of the file `config`, or the recorded one if that is empty.
[[nodiscard]] Result<OpenedRecording> open_recording(const std::string& file, const std::string& config = {});

}  // namespace abbe::daemon
