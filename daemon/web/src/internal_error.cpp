#include "internal_error.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <exception>

namespace abbe::web {

void report_internal_error(const std::function<void(const std::string&)>& report, const char* what,
                           const char* consequence) noexcept {
  try {
    report(fmt::format("internal error: {}: {}", what, consequence));
  } catch (const std::exception&) {
    for (const char* const text : {"internal error: ", what, ": ", consequence, "\n"})
      (void)std::fputs(text, stderr);
  }
}

}  // namespace abbe::web
