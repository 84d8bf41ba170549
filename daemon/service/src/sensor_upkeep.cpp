#include "sensor_upkeep.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <utility>

#include "abbe/base/text_file.hpp"
#include "abbe/base/wall_clock.hpp"
#include "abbe/result/try.hpp"
#include "abbe/service/background_tasks.hpp"
#include "outcome.hpp"

namespace abbe::daemon {
namespace {

/// Longest time for which the end of abbed waits for a hanging hub to save the state of the
/// sensors.
constexpr std::chrono::milliseconds kSensorsTimeout{100};

}  // namespace

std::optional<RecordingAttachment> SensorUpkeep::left(std::vector<std::string>& warnings) const {
  const auto checked = sensor_check_options(config_);
  const auto file = sensor_state_file(config_.daemon.data_dir);
  std::error_code failed;
  remove_half_written(file);
  if (checked.sensors.empty()) return std::nullopt;
  if (!std::filesystem::exists(file, failed) && !failed) return std::nullopt;
  const auto text = read_regular_file(file);
  auto state = text ? left_sensor_state(*text, checked, clock())
                    : Result<RecordingAttachment>{tl::unexpected(text.error())};
  if (state) return std::move(*state);
  warnings.push_back(fmt::format("{}: {}: doubts about sensors before the start are not known",
                                 file.string(), state.error().text));
  return std::nullopt;
}

void SensorUpkeep::cycle(WallTime now, Hub& hub) {
  if (writing_.valid()) {
    if (!ready(writing_)) return;
    take_outcome();
  }
  if (now < next_) return;
  next_ = now + kWritten;
  const auto checks = hub.call([&hub] { return hub.live().sensors(); }, kSensorsTimeout);
  if (!checks || checks->empty()) return;
  writing_ = run_abandonable([file = sensor_state_file(config_.daemon.data_dir),
                              text = sensor_state_text(*checks, clock())]() -> Result<void> {
    ABBE_TRY(create_folder(file.parent_path()));
    return replace_file(file, text);
  });
}

/// Reports a fault of the file once.
void SensorUpkeep::take_outcome() {
  const auto written = outcome_of(writing_);
  const std::string seen = written ? "" : written.error().text;
  if (std::exchange(fault_, seen) != seen && !seen.empty())
    fmt::print(stderr, "abbed: {}: after a restart doubts about sensors would not be known\n",
               seen);
}

SensorStateClock SensorUpkeep::clock() const {
  return {.host = time_.now(), .utc = utc_now().time_since_epoch(), .speed = config_.daemon.speed};
}

}  // namespace abbe::daemon
