#include "abbe/tasks/forced_use.hpp"

#include <fmt/format.h>
#include <pwd.h>
#include <unistd.h>

#include <utility>

#include "abbe/base/wall_clock.hpp"

namespace abbe::daemon {

Result<std::optional<StoreActor>> forced_by(const ForceOption& options) {
  if (!options.force) return std::nullopt;
  if (options.why.empty())
    return fail(ErrorCode::Usage, "--force needs --why: the reason is recorded with the result");
  return actor_now(options.why);
}

std::string user_name() {
  const passwd* user = ::getpwuid(::getuid());
  return user != nullptr ? user->pw_name : fmt::format("uid {}", ::getuid());
}

StoreActor actor_now(std::string why) {
  return {user_name(), std::move(why), utc_now()};
}

}  // namespace abbe::daemon
