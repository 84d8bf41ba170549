#pragma once
/// Checks of arguments that several tasks share. The command line makes the same checks, so that
/// its help lists the allowed values.

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
/// Usage if one of the arguments is given, because it has no effect together with `beside`.
[[nodiscard]] Result<void> require_none(std::string_view beside,
                                        std::initializer_list<GivenArgument> arguments);
/// Usage if one of the arguments is missing; `task` needs all of them.
[[nodiscard]] Result<void> require_all(std::string_view task,
                                       std::initializer_list<GivenArgument> arguments);

}  // namespace abbe::daemon
