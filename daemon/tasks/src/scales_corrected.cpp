#include "abbe/tasks/scales_corrected.hpp"

#include <fmt/format.h>

namespace abbe::daemon {

Result<void> check_scales(std::string_view command, std::string_view what, const Config& config,
                          bool corrected) {
  if (config.thermal.empty() || corrected) return {};
  return fail(
      ErrorCode::BadInput,
      fmt::format(
          "{}: [[thermal]] is configured, and the files hold no temperatures: use --recording, "
          "or give {} corrected for the temperature of the scales and add "
          "--scales-corrected",
          command, what));
}

}  // namespace abbe::daemon
