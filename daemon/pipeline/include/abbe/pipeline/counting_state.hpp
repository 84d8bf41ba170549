#pragma once
/// State of the counter card that survives a restart of the daemon: DATA_DIR/counting-state.json
/// contains the counts of the card that counts the axes, and the zero of each axis (its reading at
/// count 0). The zero refers to the counters, which continue without the daemon. It stays valid if
/// the card and its set-up are the same, the computer was not rebooted, and the clock count of the
/// card shows that the counters have continued (drivers::CounterCardReceiverOptions::resume_from).
/// The file may be a few seconds old: a zero changes only when an axis is referenced, and the file
/// is then written within a second. Not for the RT path.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/pipeline/axis_zero.hpp"
#include "abbe/pipeline/counting_progress.hpp"

namespace abbe::daemon {

/// Counts and zeros at the same time. `zero` applies to the counts of `progress`; an axis without
/// an element in `zero` is not referenced.
struct Counting {
  CountingProgress progress;
  std::vector<FoundZero> zero;
};

struct CountingState {
  std::string boot_id;  ///< host times are comparable within one boot only
  std::string set_up;   ///< counting_set_up()
  Counting counting;
};

/// All settings that determine what a count means: axes (name, channel, scale, offset, debounce),
/// clock, probe channels, width, reference marks, speed of time. JSON in one line. Requires
/// counted_axes().
[[nodiscard]] std::string counting_set_up(const Config& config);
/// Boot id of this computer: from the kernel, else from the environment variable ABBE_BOOT_ID,
/// which abbed.service sets because it hides /proc/sys from abbed. Empty: unknown.
[[nodiscard]] std::string boot_id();

[[nodiscard]] std::filesystem::path counting_state_file(const std::filesystem::path& data_dir);
/// Text of the file, with a checksum: a corrupted digit would shift the zero of an axis.
[[nodiscard]] std::string to_text(const CountingState& state);
/// Reads the text of the file. BadInput, which names `what`, for any text that to_text() does not
/// write.
[[nodiscard]] Result<CountingState> counting_state_from_text(std::string_view text,
                                                             std::string_view what);

/// State from the previous run of abbed, if it can still be valid. Whether the card has continued
/// counting is checked later, when the card reports its counts.
struct LeftCounting {
  std::optional<CountingState> state;
  std::string warning;  ///< reason why there is no state; empty if there is no file
};
/// Reads DATA_DIR/counting-state.json for `config`. A file that cannot be used is renamed to
/// counting-state.json.damaged; half-written files are removed. If no axes are counted, the result
/// is empty and no file is read.
[[nodiscard]] LeftCounting left_counting(const Config& config, const std::string& boot_id);

/// Name of the attachment of a CountingState. It is in the recording of the run that started with
/// this state, because a replay from raw bytes must start with the same state.
inline constexpr std::string_view kCountingStateName = "counting-state.json";
[[nodiscard]] RecordingAttachment to_attachment(const CountingState& state);

}  // namespace abbe::daemon
