#include "task_failure.hpp"

#include <utility>

#include "abbe/base/printable.hpp"

namespace abbe::web {

nlohmann::json failed_with(std::string text) {
  return {{"state", "failed"}, {"error", std::move(text)}};
}

std::string failure_text(const daemon::Error& error) {
  std::string text = daemon::printable(error.text);
  for (const std::string& detail : error.details) text += "\n  " + daemon::printable(detail);
  return text;
}

}  // namespace abbe::web
