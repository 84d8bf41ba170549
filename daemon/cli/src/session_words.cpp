#include "session_words.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace abbe::daemon {
namespace {

std::vector<std::string> sentences_of_verdict(const nlohmann::json& session) {
  const auto verdict = session.find("verdict");
  if (verdict == session.end()) {
    const auto reason = session.value("reason", std::string{});
    return reason.empty() ? std::vector<std::string>{} : std::vector{reason};
  }
  std::vector<std::string> lines;
  for (const auto& reason : verdict->value("reasons", nlohmann::json::array()))
    lines.push_back("reason: " + reason.get<std::string>());
  lines.push_back(verdict->value("figures", std::string{}));
  for (const auto& note : verdict->value("notes", nlohmann::json::array()))
    lines.push_back("note: " + note.get<std::string>());
  return lines;
}

}  // namespace

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
  if (state == "idle") return "not running";
  if (state == "warming") return "before the start";
  if (state == "active") return "has ended: accepted";
  return state == "refused" ? "has ended: refused" : state;
}

std::vector<std::string> sentences_of(const nlohmann::json& session) {
  auto lines = sentences_of_verdict(session);
  if (const auto again = session.value("again", std::string{}); !again.empty())
    lines.push_back("to identify this run again, with other options: " + again);
  return lines;
}

}  // namespace abbe::daemon
