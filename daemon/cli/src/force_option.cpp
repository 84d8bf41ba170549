#include "force_option.hpp"

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <chrono>
#include <utility>

#include "daemon_socket.hpp"

namespace abbe::daemon {

CLI::Option* add_force_options(CLI::App& command, ForceOption& options, const std::string& what,
                               const std::string& why) {
  command.add_option("--why,--reason", options.why, why);
  return command.add_flag("--force", options.force, what);
}

Result<std::optional<StoreActor>> forced_by(const ForceOption& options) {
  if (!options.force) return std::nullopt;
  if (options.why.empty())
    return fail(ErrorCode::Usage, "--force needs --why: the reason is recorded with the result");
  return actor_now(options.why);
}

StoreActor actor_now(std::string why) {
  return {user_name(), std::move(why),
          std::chrono::time_point_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now())};
}

}  // namespace abbe::daemon
