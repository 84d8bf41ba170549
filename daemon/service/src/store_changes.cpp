#include "abbe/service/store_changes.hpp"

#include <fmt/format.h>

#include "abbe/base/wall_clock.hpp"
#include "abbe/result/try.hpp"
#include "abbe/service/background_tasks.hpp"
#include "outcome.hpp"

namespace abbe::daemon {
namespace {

/// Longest wait for the lock of the store. If it is exceeded, the outcome names the holder of the
/// lock.
constexpr std::chrono::seconds kLockPatience{5};

StoreActor store_actor(std::string who, std::string why) {
  return {std::move(who), std::move(why), utc_now()};
}

}  // namespace

Result<std::uint64_t> StoreChanges::activate(Activation asked) {
  if (asked.force && asked.why.empty())
    return fail(ErrorCode::Usage,
                "activate: \"force\" needs \"why\": a forced activation is recorded with its "
                "reason");
  return begin([asked = std::move(asked)](ModelStore& store) -> Result<std::string> {
    auto id = store.find(asked.id);
    if (!id) return id;
    const auto done = store.activate(*id, store_actor(asked.who, asked.why), asked.force);
    ABBE_TRY(done);
    return id;
  });
}

Result<std::uint64_t> StoreChanges::roll_back(RollBack asked) {
  return begin([asked = std::move(asked)](ModelStore& store) {
    return store.rollback(store_actor(asked.who, asked.why), asked.active);
  });
}

Result<std::uint64_t> StoreChanges::add(Addition asked) {
  return begin([asked = std::move(asked)](ModelStore& store) -> Result<std::string> {
    const auto document = parse_model(asked.model, "model");
    ABBE_TRY(document);
    if (!document->verdict)
      return fail(ErrorCode::BadInput, "add: the gate has not judged this model");
    if (const auto unfit = unfit_for(*document, asked.present, ""); !unfit.empty())
      return fail(ErrorCode::Refused, fmt::format("add {}: {}", model_id(*document), unfit));
    return store.add(*document, document->verdict->accepted, document->verdict->reasons,
                     store_actor(asked.who, asked.why));
  });
}

Result<std::uint64_t> StoreChanges::begin(Change change) {
  const std::lock_guard lock(mutex_);
  if (running_.valid() && !ready(running_))
    return fail(ErrorCode::Refused,
                fmt::format("change {} of the model store is not done yet: try again in some "
                            "seconds",
                            number_));

  running_ =
      run_abandonable([folder = store_, change = std::move(change)]() -> Result<std::string> {
        auto store = ModelStore::open(folder);
        ABBE_TRY(store);
        store->set_lock_timeout(kLockPatience);
        return change(*store);
      });
  done_.reset();
  return ++number_;
}

std::optional<Result<std::string>> StoreChanges::outcome(std::uint64_t number,
                                                         std::chrono::milliseconds patience) {
  const std::lock_guard lock(mutex_);
  if (number == 0 || number != number_)
    return fail(ErrorCode::Usage, fmt::format("change {} of the model store is not known; the "
                                              "last one is {}",
                                              number, number_));
  if (running_.valid()) {
    if (running_.wait_for(patience) != std::future_status::ready) return std::nullopt;
    done_ = outcome_of(running_);
  }
  return done_;
}

}  // namespace abbe::daemon
