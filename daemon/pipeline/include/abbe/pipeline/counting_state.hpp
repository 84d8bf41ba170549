#pragma once
/// What a restart of the daemon must not forget of the card of [counter_card]:
/// DATA_DIR/counting-state.json keeps how far its counters had come, and the datum of each axis.
/// The datum belongs to the counters, which count on without the daemon: it goes on if the same
/// card, with the same set-up, in the same boot of this computer, still counts its clock where it
/// must (drivers::CounterCardReceiverOptions::resume_from). The file may be seconds old, because
/// the datum changes only when an axis is referenced. Ordinary world.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"
#include "abbe/drivers/counter_card/progress.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/pipeline/datum.hpp"

namespace abbe::daemon {

/// `datum` holds for the counts of `progress`; an axis that is not in it is not referenced.
struct Counting {
  drivers::CounterCardProgress progress;
  std::vector<FoundDatum> datum;
};

struct CountingState {
  std::string boot_id;  ///< host time begins anew with each boot
  std::string set_up;   ///< as counting_set_up()
  Counting counting;
};

/// What gives a count its meaning: axes (name, channel, scale, offset, debounce), clock, probe
/// channels, width, reference marks, speed of time. JSON in one line. `config.counter_card` is
/// there.
[[nodiscard]] std::string counting_set_up(const Config& config);
/// Of the running computer: the kernel's, else the environment variable ABBE_BOOT_ID (abbed.service
/// sets it, because it hides /proc/sys). Empty: unknown.
[[nodiscard]] std::string boot_id();

[[nodiscard]] std::filesystem::path counting_state_file(const std::filesystem::path& data_dir);
/// With a checksum: a changed digit must not become another zero.
[[nodiscard]] std::string to_text(const CountingState& state);
/// BadInput, named `what`, for all that to_text() does not write.
[[nodiscard]] Result<CountingState> counting_state_from_text(std::string_view text,
                                                             std::string_view what);

/// What the last run left, as far as it may go on: the card has still to show that it counted
/// meanwhile.
struct LeftCounting {
  std::optional<CountingState> state;
  std::string warning;  ///< why not; empty without a file
};
/// Reads DATA_DIR/counting-state.json for `config`. A file that cannot be used is renamed to
/// counting-state.json.damaged; half-written ones are removed. Without [counter_card]: nothing.
[[nodiscard]] LeftCounting left_counting(const Config& config, const std::string& boot_id);

/// As it lies in the recording of the run that goes on from it, for a replay from raw bytes.
inline constexpr std::string_view kCountingStateName = "counting-state.json";
[[nodiscard]] RecordingAttachment to_attachment(const CountingState& state);

}  // namespace abbe::daemon
