#pragma once
/// A recording, and the configuration with which it is replayed.

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

/// The configuration is that of the file `config`, or the recorded one if that is empty.
[[nodiscard]] Result<OpenedRecording> open_recording(const std::string& file,
                                                     const std::string& config = {});

}  // namespace abbe::daemon
