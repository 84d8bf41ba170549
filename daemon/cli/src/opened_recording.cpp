#include "opened_recording.hpp"

#include <filesystem>
#include <utility>

#include "abbe/base/sha256.hpp"
#include "abbe/replay/replay.hpp"

namespace abbe::daemon {

Result<OpenedRecording> open_recording(const std::string& file, const std::string& config) {
  auto reader = RecordingReader::open(file);
  if (!reader) return tl::make_unexpected(reader.error());
  const auto recorded = recorded_config(*reader, file);
  auto read = config.empty() ? recorded : load_config(config);
  if (!read) return tl::make_unexpected(read.error());
  if (!config.empty()) take_recorded_readings(*read, recorded ? &*recorded : nullptr);
  const auto hash = sha256_hex_of_file(file);
  if (!hash) return tl::make_unexpected(hash.error());
  return OpenedRecording{std::move(*reader),
                         std::move(*read),
                         {std::filesystem::path(file).filename().string(), *hash}};
}

void take_recorded_readings(Config& config, const Config* recorded) {
  auto& [readings, measurements] = config.meaning;
  if (recorded == nullptr) {
    set_entry(readings, "daemon.simulated", "not known");
    return;
  }
  take_entries(readings, recorded->meaning.readings,
               {"machine", "axes", "target", "model", "thermal"});
  measurements = recorded->meaning.measurements;
}

}  // namespace abbe::daemon
