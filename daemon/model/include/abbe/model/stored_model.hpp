#pragma once
/// A model as the store returns it: the document with the verdict of the store, and the events of
/// the model.

#include <string>
#include <vector>

#include "abbe/model/model_store.hpp"

namespace abbe::daemon {

struct StoredModel {
  /// The verdict in the document is that of the last time the model was added; a forced activation
  /// is included, although later events do not change the file in the store. If the store has no
  /// entry for the model (its state was damaged), it is the verdict of the file.
  ModelDocument document;
  StoreEntry entry;
  std::vector<StoreEvent> events;  ///< events of this model, oldest first
};

/// Reads one model and the state of the store.
[[nodiscard]] Result<StoredModel> stored_model(const ModelStore& store, const std::string& id);

}  // namespace abbe::daemon
