#pragma once

#include <functional>
#include <string>

namespace abbe::web {

/// Reports "internal error: WHAT: CONSEQUENCE". If there is no memory for this line, the texts go
/// to standard error: a thread that reports an exception must not end with another one. Any thread.
void report_internal_error(const std::function<void(const std::string&)>& report, const char* what,
                           const char* consequence) noexcept;

}  // namespace abbe::web
