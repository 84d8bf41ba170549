#include "abbe/recording/old_recordings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string>

#include "abbe/model/model_store.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

/// The names of all recordings that models name among their inputs, without extension. A model
/// names "NAME.mcap", or "NAME.mcap.part (4711 bytes)" if the recording was still open.
Result<std::set<std::string>> named_by_models(const fs::path& folder) {
  std::set<std::string> names;
  // ModelStore::open() would create a missing store; a store on a disk that is not mounted must not
  // count as empty.
  std::error_code error;
  if (!fs::is_directory(folder / "models", error))
    return fail(ErrorCode::Io, fmt::format("list {}: there is no model store", folder.string()));
  const auto store = ModelStore::open(folder);
  ABBE_TRY(store);
  const auto entries = store->list();
  ABBE_TRY(entries);

  for (const auto& entry : *entries) {
    if (!entry.fault.empty()) return fail(ErrorCode::BadInput, entry.fault);
    for (const auto& input : entry.inputs) names.insert(input.substr(0, input.find('.')));
  }

  return names;
}

bool is_recording(const std::string& name) {
  return name.starts_with("abbe-") && (name.ends_with(".mcap") || name.ends_with(".mcap.part"));
}

/// True for NAME.mcap, NAME-2.mcap ...
bool is_of_run(const std::string& file, const std::string& name) {
  return !name.empty() && file.starts_with(name) &&
         (file[name.size()] == '.' || file[name.size()] == '-');
}

/// The date of the first version of abbe. A file with an earlier date was written while the clock
/// was wrong (empty battery of the real-time clock).
fs::file_time_type earliest_date() {
  using namespace std::chrono;
  return file_clock::from_sys(sys_seconds{sys_days{year{2026} / January / 1}});
}

struct Dated {
  fs::path file;
  fs::file_time_type written;
};

struct Recordings {
  std::vector<Dated> former, own;
};

/// All recordings except the one that is being written.
Result<Recordings> recordings_in(const fs::path& directory, const std::string& running) {
  Recordings found;
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code unknown;
    const std::string name = entry->path().filename();
    const bool regular = entry->symlink_status(unknown).type() == fs::file_type::regular;
    const bool own = is_of_run(name, running);
    if (!regular || !is_recording(name) || (own && name.ends_with(".part"))) continue;
    const auto written = entry->last_write_time(unknown);
    if (!unknown) (own ? found.own : found.former).push_back({entry->path(), written});
  }

  if (error)
    return fail(ErrorCode::Io, fmt::format("list {}: {}", directory.string(), error.message()));
  return found;
}

/// The files that are older than the rule permits, ordered by name.
std::vector<fs::path> outdated(const Recordings& recordings, const KeepRule& rule) {
  std::vector<fs::path> old;
  const auto add = [&old](const std::vector<Dated>& some, fs::file_time_type until) {
    for (const auto& [file, written] : some)
      if (written < until && written >= earliest_date()) old.push_back(file);
  };

  add(recordings.own, rule.now - rule.keep);
  if (rule.lasted > rule.keep) {  // `now` is reliable, because the clock was not set during
                                  // `lasted`
    add(recordings.former, rule.now - rule.keep);
  } else if (!recordings.former.empty()) {
    const auto newest = std::ranges::max(recordings.former, {}, &Dated::written).written;
    add(recordings.former, std::min(newest, rule.now) - rule.keep);
  }

  std::sort(old.begin(), old.end());
  return old;
}

}  // namespace

Result<std::vector<fs::path>> remove_old_recordings(const fs::path& directory,
                                                    const fs::path& store, const KeepRule& rule) {
  const auto recordings = recordings_in(directory, rule.running);
  ABBE_TRY(recordings);
  std::vector<fs::path> old = outdated(*recordings, rule);
  if (old.empty()) return old;
  const auto named = named_by_models(store);
  if (!named)
    return fail(named.error().code,
                fmt::format("keep all recordings, although some are older than keep_days: {}",
                            named.error().text));

  std::erase_if(old, [&named](const fs::path& file) {
    const std::string name = file.filename();
    return named->contains(name.substr(0, name.find('.')));  // this also matches NAME.damaged.mcap
  });

  std::error_code error;
  for (const fs::path& file : old)
    if (!fs::remove(file, error) && error)
      return fail(ErrorCode::Io, fmt::format("remove {}: {}", file.string(), error.message()));

  return old;
}

}  // namespace abbe::daemon
