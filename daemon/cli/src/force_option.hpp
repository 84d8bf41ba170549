#pragma once
/// --force and --why: a person uses a model although it must not be used.

#include <CLI/App.hpp>
#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/model/model_verdict.hpp"

namespace abbe::daemon {

struct ForceOption {
  bool force = false;
  std::string why;
};

/// `what` is done by force; `why`: help of --why. --reason is another name of --why.
CLI::Option* add_force_options(CLI::App& command, ForceOption& options, const std::string& what,
                               const std::string& why);

/// This user with the reason, now; nullopt without --force. Usage for --force without --why.
[[nodiscard]] Result<std::optional<StoreActor>> forced_by(const ForceOption& options);
/// This user and the time now.
[[nodiscard]] StoreActor actor_now(std::string why);

}  // namespace abbe::daemon
