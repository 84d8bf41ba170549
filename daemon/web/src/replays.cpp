#include "abbe/web/replays.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <exception>
#include <fstream>
#include <optional>
#include <system_error>

#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/replay_recording.hpp"
#include "abbe/web/recording_list.hpp"
#include "internal_error.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;
using nlohmann::json;

constexpr std::size_t kLongestResult = 4u << 20;
constexpr int kLowPriority = 19;
constexpr std::chrono::milliseconds kMemoryPeriod{100};

/// 0 if it is not known.
std::uint64_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  std::uint64_t size_pages = 0, resident_pages = 0;
  if (!(file >> size_pages >> resident_pages)) return 0;
  return resident_pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

/// Whether a replay must end before its end. Belongs to the thread of the replay.
class EarlyEnd {
 public:
  EarlyEnd(const ReplayLimits& limits, const std::atomic<bool>& stopping)
      : limits_(limits), stopping_(stopping) {}

  /// Once true, it stays so.
  bool wanted() {
    if (!reason_) reason_ = reason_now();
    return reason_.has_value();
  }
  /// nullopt: not wanted.
  [[nodiscard]] const std::optional<std::string>& reason() const { return reason_; }

 private:
  using Clock = std::chrono::steady_clock;

  std::optional<std::string> reason_now() {
    if (stopping_) return "abbe-web stops: the replay was ended";
    const auto now = Clock::now();
    if (now > begin_ + limits_.time)
      return fmt::format("abbe replay took longer than {} min and was ended", limits_.time.count());
    if (now < next_memory_) return std::nullopt;
    next_memory_ = now + kMemoryPeriod;
    if (resident_bytes() > limits_.memory_bytes)
      return fmt::format("abbe-web has more than {} MiB of memory: the replay was ended",
                         limits_.memory_bytes >> 20);
    return std::nullopt;
  }

  const ReplayLimits& limits_;
  const std::atomic<bool>& stopping_;
  Clock::time_point begin_ = Clock::now(), next_memory_ = begin_;
  std::optional<std::string> reason_;
};

json failed_with(std::string text) {
  return {{"state", "failed"}, {"error", std::move(text)}};
}

std::string failure_text(const daemon::Error& error) {
  std::string text = daemon::printable(error.text);
  for (const std::string& detail : error.details) text += "\n  " + daemon::printable(detail);
  return text;
}

}  // namespace

Replays::~Replays() {
  stop();
  if (thread_.joinable()) thread_.join();
}

Result<void> Replays::begin(const std::string& name) {
  ABBE_TRY(open_recording(folder_, name));
  const std::lock_guard lock(mutex_);
  if (running_)
    return daemon::fail(ErrorCode::Refused, "another recording is being replayed: wait for it");
  if (thread_.joinable()) thread_.join();

  json failed = failed_with("internal error: see the log of abbe-web");
  failed["name"] = name;
  json running{{"state", "running"}, {"name", name}};
  try {
    thread_ = std::thread(
        [this, name, failed = std::move(failed)]() mutable { work(name, std::move(failed)); });
  } catch (const std::system_error& error) {  // TasksMax of the unit
    return daemon::fail(ErrorCode::Io, fmt::format("replay of {}: no thread can be started: {}",
                                                   name, error.code().message()));
  }
  running_ = true;
  status_ = std::move(running);
  return {};
}

/// `failed`: the status after an internal error, made before memory can be short.
void Replays::work(const std::string& name, json failed) {
  (void)::setpriority(PRIO_PROCESS, 0, kLowPriority);  // of this thread
  try {
    json outcome = outcome_of(name);
    outcome["name"] = name;
    failed = std::move(outcome);
  } catch (const std::exception& error) {
    report_internal_error(report_, error.what(), "the replay has failed");
  } catch (...) {
    report_internal_error(report_, "not a std::exception", "the replay has failed");
  }
  (void)::malloc_trim(0);  // a replay may have used much memory
  end(std::move(failed));
}

json Replays::outcome_of(const std::string& name) const {
  EarlyEnd early(limits_, stopping_);
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

void Replays::end(json outcome) {
  const std::lock_guard lock(mutex_);
  running_ = false;
  status_ = std::move(outcome);
}

json Replays::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace abbe::web
