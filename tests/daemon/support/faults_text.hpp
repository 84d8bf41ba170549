#pragma once

#include <string>

#include "abbe/base/error.hpp"

namespace abbe::daemon::test {

/// Text and details of the error of a reader; empty if the reader accepts the file.
template <class T>
[[nodiscard]] std::string faults_text(const Result<T>& result) {
  if (result) return {};
  std::string text = result.error().text;
  for (const auto& detail : result.error().details) text += "\n" + detail;
  return text;
}

}  // namespace abbe::daemon::test
