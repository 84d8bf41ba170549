#include "abbe/web/replays.hpp"

#include <fmt/format.h>

#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/replay_recording.hpp"
#include "abbe/web/recording_list.hpp"
#include "early_end.hpp"
#include "task_failure.hpp"

namespace abbe::web {
namespace {

using nlohmann::json;

constexpr std::size_t kLongestResult = 4u << 20;

}  // namespace

daemon::Result<void> Replays::begin(const std::string& name) {
  ABBE_TRY(open_recording(folder_, name));
  return thread_.begin({{"name", name}}, [this, name] { return outcome_of(name); });
}

json Replays::outcome_of(const std::string& name) const {
  EarlyEnd early("replay", limits_, [this] {
    return stopping_ ? std::string{"abbe-web stops: the replay was ended"} : std::string{};
  });
  const std::string file = (folder_ / name).string();
  std::string losses;
  const auto replayed = daemon::replay_recording(
      {.file = file},
      [&](const daemon::RecordingLoss& loss) {
        losses += fmt::format("{}: {}\n", daemon::printable_line(file),
                              daemon::printable_line(loss.what));
      },
      daemon::Progress({}, [&early] { return early.wanted(); }));
  if (early.reason()) return failed_with(*early.reason());
  if (!replayed) return failed_with(losses + failure_text(replayed.error()));
  json result = daemon::replay_json(*replayed);
  if (daemon::json_text(result).size() > kLongestResult)
    return failed_with(fmt::format("the result has more than {} MiB: abbe replay {} prints it",
                                   kLongestResult >> 20, file));
  return {{"state", "done"}, {"result", std::move(result)}};
}

}  // namespace abbe::web
