#include "abbe/pipeline/session_status.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace abbe::daemon {

std::string_view name(SessionState state) noexcept {
  static constexpr std::array<std::string_view, 7> kNames{
      "idle", "warming", "acquiring", "identifying", "judged", "active", "refused"};
  return kNames[static_cast<std::size_t>(state)];
}

bool LiveTable::determined() const noexcept {
  return std::ranges::none_of(u, [](double each) { return std::isnan(each); });
}

}  // namespace abbe::daemon
