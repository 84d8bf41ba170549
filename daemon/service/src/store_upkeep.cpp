#include "store_upkeep.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>

#include "abbe/base/wall_clock.hpp"
#include "abbe/result/try.hpp"
#include "abbe/service/background_tasks.hpp"
#include "outcome.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;

constexpr auto kPeriod = 1h;

/// Removes the models that are not kept and returns their ids. Listing the models updates the
/// index.
Result<std::vector<std::string>> keep_up(const std::filesystem::path& folder,
                                         const ModelRetention& retention) {
  ModelStore store{folder};
  const StoreActor actor{
      "abbed",
      fmt::format("[models] keep_newest = {}, keep_days = {}", retention.keep_newest,
                  std::chrono::duration_cast<std::chrono::days>(retention.keep).count()),
      utc_now()};
  auto removed = store.remove_old(retention, actor);
  if (!removed) return removed;
  ABBE_TRY(store.list());
  return removed;
}

}  // namespace

void StoreUpkeep::cycle(WallTime now) {
  if (ready(work_)) {
    const auto removed = outcome_of(work_);
    if (!removed)
      fmt::print(stderr, "abbed: upkeep of the model store: {}\n", removed.error().text);
    else if (!removed->empty())
      fmt::print(stderr, "abbed: {} models removed, which [models] does not keep\n",
                 removed->size());
  }

  if (work_.valid() || now < next_) return;
  next_ = now + kPeriod;
  work_ = run_abandonable(
      [store = store_, retention = retention_] { return keep_up(store, retention); });
}

}  // namespace abbe::daemon
