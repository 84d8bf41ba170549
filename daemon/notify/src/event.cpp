#include "abbe/notify/event.hpp"

namespace abbe::notify {

std::string_view name_of(Severity severity) noexcept {
  if (severity == Severity::Info) return "info";
  return severity == Severity::Warning ? "warning" : "fault";
}

std::string_view name_of(Phase phase) noexcept {
  if (phase == Phase::Happened) return "happened";
  return phase == Phase::Begins ? "begins" : "ends";
}

}  // namespace abbe::notify
