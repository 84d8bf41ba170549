#pragma once
/// Checks that the arguments of several tasks have in common. The command line makes them again, so
/// that its help names what is possible.

#include <initializer_list>
#include <string_view>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Usage unless `text` is empty or one of `words`.
[[nodiscard]] Result<void> require_word(std::string_view argument, std::string_view text,
                                        std::initializer_list<std::string_view> words);

struct GivenArgument {
  std::string_view name;
  bool given = false;
};
/// Usage if one of the arguments is given: it has no effect beside `beside`.
[[nodiscard]] Result<void> require_none(std::string_view beside,
                                        std::initializer_list<GivenArgument> arguments);
/// Usage if one of the arguments is missing, which `task` needs.
[[nodiscard]] Result<void> require_all(std::string_view task,
                                       std::initializer_list<GivenArgument> arguments);

}  // namespace abbe::daemon
