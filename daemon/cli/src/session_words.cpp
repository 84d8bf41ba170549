#include "session_words.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace abbe::daemon {

std::string remaining_time(const nlohmann::json& session) {
  const auto remaining = session.find("remaining_s");
  if (remaining == session.end() || !remaining->is_number()) return {};
  constexpr double kSecondsInMinute = 60.0, kMostSeconds = 59.5;  // 59.5 would be shown as 60 s
  const double seconds = std::max(0.0, remaining->get<double>());
  return seconds < kMostSeconds ? fmt::format("about {:.0f} s left", seconds)
                                : fmt::format("about {:.1f} min left", seconds / kSecondsInMinute);
}

std::string state_in_words(const nlohmann::json& session) {
  const auto state = session.at("state").get<std::string>();
  return state == "warming" ? "start" : state;
}

}  // namespace abbe::daemon
