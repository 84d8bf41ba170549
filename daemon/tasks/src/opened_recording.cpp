#include "abbe/tasks/opened_recording.hpp"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <utility>

#include "abbe/base/input_file.hpp"
#include "abbe/replay/replay.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

namespace {

/// The present name of a recording. While a recording is written its name ends in ".part", which is
/// removed when the recording is closed.
std::string present_name(const std::string& file) {
  constexpr std::string_view kOpen = ".part";
  std::error_code unknown;
  if (std::filesystem::exists(file, unknown)) return file;
  const std::string other = file.ends_with(kOpen) ? file.substr(0, file.size() - kOpen.size())
                                                  : file + std::string(kOpen);
  return std::filesystem::exists(other, unknown) ? other : file;
}

}  // namespace

Result<OpenedRecording> open_recording(const std::string& named, const std::string& config,
                                       const std::function<bool()>& stopped) {
  const std::string file = present_name(named);
  auto reader = RecordingReader::open(file, stopped);
  ABBE_TRY(reader);
  const auto recorded = recorded_config(*reader, file);
  auto read = config.empty() ? recorded : load_config(config);
  ABBE_TRY(read);
  if (!config.empty()) take_recorded_readings(*read, recorded ? &*recorded : nullptr);
  auto source = hashed_file(file);
  ABBE_TRY(source);
  return OpenedRecording{std::move(*reader), std::move(*read), std::move(*source)};
}

namespace {

/// The [[thermal]] tables of `config`, with the recorded temperatures of the same names.
std::vector<ThermalConfig> thermal_of_recorded(const Config& config, const Config& recorded) {
  std::vector<ThermalConfig> all;
  for (ThermalConfig thermal : config.thermal) {
    const auto at =
        std::ranges::find(recorded.temperatures, config.temperatures[thermal.temperature]);
    if (at == recorded.temperatures.end()) continue;
    thermal.temperature = static_cast<std::uint8_t>(at - recorded.temperatures.begin());
    all.push_back(std::move(thermal));
  }
  return all;
}

/// Sets the sensors that correct a reading to the recorded ones. [[thermal]], which stays that of
/// `config`, determines which sensors these are.
void take_recorded_sensors(Config& config, const Config& recorded) {
  Config sensors = recorded;
  sensors.thermal = thermal_of_recorded(config, recorded);
  const auto [readings, measurements] = environment_meaning(sensors);
  const auto take = [](MeaningEntries& entries, const MeaningEntries& taken) {
    std::erase_if(entries, [](const auto& entry) { return entry.key.starts_with("environment."); });
    for (const auto& [key, value] : taken) set_entry(entries, key, value);
  };
  take(config.meaning.readings, readings);
  take(config.meaning.measurements, measurements);
}

}  // namespace

void take_recorded_readings(Config& config, const Config* recorded) {
  auto& [readings, measurements] = config.meaning;
  if (recorded == nullptr) {
    set_entry(readings, "daemon.simulated", "not known");
    return;
  }
  take_entries(readings, recorded->meaning.readings,
               {"machine", "axes", "target", "model", "thermal"});
  measurements = recorded->meaning.measurements;
  take_recorded_sensors(config, *recorded);
}

}  // namespace abbe::daemon
