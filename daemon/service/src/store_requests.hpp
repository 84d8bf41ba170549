#pragma once
/// The requests that change which model is active, for clients that may not write to the store.

#include <filesystem>
#include <string>

#include "on_hub.hpp"

namespace abbe::daemon {

struct Activation {
  std::string id;
  std::string who, why;  ///< kept in the store
  bool force = false;    ///< also a model that the gate refused; needs `why`
};

/// Changes the store on an ordinary thread and waits for it, at most 3 s. An Error of the store, or
/// Io if the store does not answer in that time; the change may then still take place. Not for the
/// hub's thread.
[[nodiscard]] Result<OnHub> activate_model(std::filesystem::path store, Activation asked);
/// The same for the model that was active before; returns its id as "id".
[[nodiscard]] Result<OnHub> roll_back_model(std::filesystem::path store, std::string who,
                                            std::string why);

}  // namespace abbe::daemon
