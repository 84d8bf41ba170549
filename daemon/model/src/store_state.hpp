#pragma once
/// state.json: the events of a store in order, and the active model that results from them.

#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "abbe/model/model_store.hpp"

namespace abbe::daemon {

struct StoreState {
  std::vector<StoreEvent> events;

  /// The ids of all activations that were not rolled back, oldest first; the last one is active.
  [[nodiscard]] std::vector<std::string> activations() const;
  [[nodiscard]] std::optional<std::string> active() const;
  /// The event that made the active model active. Its `accepted` and `reasons` are the verdict of
  /// the gate when the model was added, its `accepted_configuration` is the last one of the model.
  [[nodiscard]] std::optional<StoreEvent> activation() const;
  /// Reason of the last Drifted event since the last activation; empty: there is none.
  [[nodiscard]] std::string drift() const;
  /// null if the model was never added, or was removed since
  [[nodiscard]] const StoreEvent* last_added(std::string_view id) const;
  /// The last Added or Removed event of each model, by id. The pointers point into `events`.
  [[nodiscard]] std::unordered_map<std::string_view, const StoreEvent*> models() const;
  /// The ids that ModelStore::remove_old() removes, oldest first.
  [[nodiscard]] std::vector<std::string> beyond(const ModelRetention& retention,
                                                protocol::UtcTime now) const;
};

[[nodiscard]] std::string to_text(const StoreState& state);
[[nodiscard]] Result<StoreState> store_state_from_text(std::string_view text,
                                                       const std::string& file);

}  // namespace abbe::daemon
