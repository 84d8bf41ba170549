#include "store_requests.hpp"

#include <fmt/format.h>

#include <chrono>
#include <utility>

#include "abbe/model/model_store.hpp"
#include "abbe/service/background_tasks.hpp"
#include "outcome.hpp"

namespace abbe::daemon {
namespace {

constexpr std::chrono::seconds kStorePatience{3};
/// Shorter than kStorePatience, so that the answer names the lock.
constexpr std::chrono::seconds kLockPatience{2};

StoreActor store_actor(std::string who, std::string why) {
  return {std::move(who), std::move(why),
          std::chrono::time_point_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now())};
}

/// Runs `change`, which returns the id of the active model, and answers with that id.
template <class Change>
Result<OnHub> change_store(Change change) {
  auto outcome = run_abandonable(std::move(change));
  if (outcome.wait_for(kStorePatience) != std::future_status::ready)
    return fail(ErrorCode::Io,
                fmt::format("the model store has not answered for {} s; the change may still take "
                            "place: see `abbe model list`",
                            kStorePatience.count()));
  auto id = outcome_of(outcome);
  if (!id) return tl::unexpected(id.error());
  return [id = std::move(*id)](const Hub&) {
    return reply(nlohmann::json{{"ok", true}, {"id", id}});
  };
}

Result<ModelStore> store_at(const std::filesystem::path& folder) {
  auto store = ModelStore::open(folder);
  if (store) store->set_lock_timeout(kLockPatience);
  return store;
}

}  // namespace

Result<OnHub> activate_model(std::filesystem::path store, Activation asked) {
  if (asked.force && asked.why.empty())
    return fail(ErrorCode::Usage,
                "activate: \"force\" needs \"why\": a forced activation is recorded with its "
                "reason");
  return change_store(
      [store = std::move(store), asked = std::move(asked)]() -> Result<std::string> {
        auto opened = store_at(store);
        if (!opened) return tl::unexpected(opened.error());
        auto id = opened->find(asked.id);
        if (!id) return id;
        const auto done = opened->activate(*id, store_actor(asked.who, asked.why), asked.force);
        if (!done) return tl::unexpected(done.error());
        return id;
      });
}

Result<OnHub> roll_back_model(std::filesystem::path store, std::string who, std::string why) {
  return change_store([store = std::move(store), who = std::move(who),
                       why = std::move(why)]() -> Result<std::string> {
    auto opened = store_at(store);
    if (!opened) return tl::unexpected(opened.error());
    return opened->rollback(store_actor(who, why));
  });
}

}  // namespace abbe::daemon
