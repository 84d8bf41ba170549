#include "abbe/pipeline/session_status.hpp"

#include <array>

namespace abbe::daemon {

std::string_view name(SessionState state) noexcept {
  static constexpr std::array<std::string_view, 7> kNames{
      "idle", "warming", "acquiring", "identifying", "judged", "active", "refused"};
  return kNames[static_cast<std::size_t>(state)];
}

}  // namespace abbe::daemon
