#pragma once
/// A model as its store knows it: the document with the verdict of the store, and its events.

#include <string>
#include <vector>

#include "abbe/model/model_store.hpp"

namespace abbe::daemon {

struct StoredModel {
  /// Its verdict is that of the last time the model was added, with a forced activation: the file
  /// in the store is not changed by later events. Without an entry of the store (its state was
  /// damaged) it is the verdict of the file.
  ModelDocument document;
  StoreEntry entry;
  std::vector<StoreEvent> events;  ///< of this model, oldest first
};

/// Reads one model and the state of the store.
[[nodiscard]] Result<StoredModel> stored_model(const ModelStore& store, const std::string& id);

}  // namespace abbe::daemon
