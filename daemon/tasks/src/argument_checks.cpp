#include "argument_checks.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace abbe::daemon {

Result<void> require_word(std::string_view argument, std::string_view text,
                          std::initializer_list<std::string_view> words) {
  if (text.empty() || std::ranges::find(words, text) != words.end()) return {};
  return fail(ErrorCode::Usage,
              fmt::format("{}: \"{}\": must be {}", argument, text, fmt::join(words, ", ")));
}

Result<void> require_none(std::string_view beside, std::initializer_list<GivenArgument> arguments) {
  const auto given = std::ranges::find_if(arguments, &GivenArgument::given);
  if (given == arguments.end()) return {};
  return fail(ErrorCode::Usage,
              fmt::format("{} has no effect beside {}: leave one out", given->name, beside));
}

Result<void> require_all(std::string_view task, std::initializer_list<GivenArgument> arguments) {
  const auto missing = std::ranges::find(arguments, false, &GivenArgument::given);
  if (missing == arguments.end()) return {};
  return fail(ErrorCode::Usage, fmt::format("{} needs {}", task, missing->name));
}

}  // namespace abbe::daemon
