#include <fmt/format.h>

#include "abbe/base/utc_text.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {

std::optional<std::array<protocol::UtcTime, 2>> measured_of(const ModelDocument& document) {
  if (!document.run || !document.run->conditions) return std::nullopt;
  return document.run->conditions->measured;
}

std::string when_in_words(const ModelDocument& document) {
  if (const auto measured = measured_of(document))
    return fmt::format("measured {} to {}", to_seconds((*measured)[0]), to_seconds((*measured)[1]));
  return fmt::format("identified {}; when it was measured is not recorded",
                     to_seconds(document.created));
}

protocol::UtcTime time_of(const ModelDocument& document) {
  const auto measured = measured_of(document);
  return measured ? (*measured)[1] : document.created;
}

std::string to_seconds(protocol::UtcTime time) {
  constexpr std::size_t kSeconds = 19;  // "2024-05-17T08:30:00"
  return to_text(time).substr(0, kSeconds) + "Z";
}

}  // namespace abbe::daemon
