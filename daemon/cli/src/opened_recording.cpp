#include "opened_recording.hpp"

#include <filesystem>
#include <utility>

#include "abbe/base/sha256.hpp"
#include "abbe/replay/replay.hpp"

namespace abbe::daemon {

Result<OpenedRecording> open_recording(const std::string& file, const std::string& config) {
  auto reader = RecordingReader::open(file);
  if (!reader) return tl::make_unexpected(reader.error());
  auto read = config.empty() ? recorded_config(*reader, file) : load_config(config);
  if (!read) return tl::make_unexpected(read.error());
  const auto hash = sha256_hex_of_file(file);
  if (!hash) return tl::make_unexpected(hash.error());
  return OpenedRecording{std::move(*reader),
                         std::move(*read),
                         {std::filesystem::path(file).filename().string(), *hash}};
}

}  // namespace abbe::daemon
