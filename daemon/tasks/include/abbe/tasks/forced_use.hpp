#pragma once
/// Records that a person uses a model although it must not be used: who, when and why.

#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/model/model_verdict.hpp"

namespace abbe::daemon {

struct ForceOption {
  bool force = false;
  std::string why;
};

/// The user of this process, the present time and the reason; nullopt without --force. Usage for
/// --force without --why.
[[nodiscard]] Result<std::optional<StoreActor>> forced_by(const ForceOption& options);
/// The name of the user who runs this program. The daemon and the store record it with each change.
[[nodiscard]] std::string user_name();
/// The user of this process and the present time, with the reason `why`.
[[nodiscard]] StoreActor actor_now(std::string why);

}  // namespace abbe::daemon
