#include "abbe/base/refusal.hpp"

#include <algorithm>
#include <array>
#include <string_view>

namespace abbe::daemon {
namespace {

constexpr std::array<std::string_view, 7> kCodes{
    "data_insufficient",  "usage",        "bad_input", "io", "refused",
    "stop_not_confirmed", "stop_not_sent"};

std::string text_of(const nlohmann::json& answer, const char* member) {
  const auto found = answer.find(member);
  return found != answer.end() && found->is_string() ? found->get<std::string>() : std::string{};
}

}  // namespace

std::string_view code_name(ErrorCode code) noexcept {
  return kCodes[static_cast<std::size_t>(code)];
}

nlohmann::json refusal(const Error& error) {
  return {{"ok", false}, {"code", code_name(error.code)}, {"error", error.text}};
}

Error error_of_refusal(const nlohmann::json& answer) {
  const auto word = std::find(kCodes.begin(), kCodes.end(), text_of(answer, "code"));
  const auto code =
      word == kCodes.end() ? ErrorCode::Refused : static_cast<ErrorCode>(word - kCodes.begin());
  const std::string text = text_of(answer, "error");
  return {code, text.empty() ? "the daemon refused the request and gave no reason" : text};
}

}  // namespace abbe::daemon
