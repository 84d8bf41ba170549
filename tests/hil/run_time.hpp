#pragma once
/// How long a measured run of this folder lasts: ABBE_HIL_SECONDS, set by scripts/test-hil.

#include <chrono>
#include <cstdlib>

namespace abbe::tests {

inline std::chrono::seconds run_time(std::chrono::seconds otherwise) {
  const char* seconds = std::getenv("ABBE_HIL_SECONDS");
  return seconds != nullptr ? std::chrono::seconds{std::atoi(seconds)} : otherwise;
}

}  // namespace abbe::tests
