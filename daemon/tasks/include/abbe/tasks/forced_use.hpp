#pragma once
/// A person uses a model although it must not be used: who, when and why.

#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/model/model_verdict.hpp"

namespace abbe::daemon {

struct ForceOption {
  bool force = false;
  std::string why;
};

/// This user with the reason, now; nullopt without --force. Usage for --force without --why.
[[nodiscard]] Result<std::optional<StoreActor>> forced_by(const ForceOption& options);
/// The name of the user who runs this program, recorded by the daemon and the store with what the
/// program changes.
[[nodiscard]] std::string user_name();
/// This user and the time now.
[[nodiscard]] StoreActor actor_now(std::string why);

}  // namespace abbe::daemon
