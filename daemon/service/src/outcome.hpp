#pragma once
/// The result of a background task, with an exception converted to an Error.

#include <chrono>
#include <exception>
#include <future>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// True if outcome_of() would not have to wait. False if `work` is not valid.
template <class T>
[[nodiscard]] bool ready(const std::future<T>& work) {
  return work.valid() && work.wait_for(std::chrono::seconds{0}) == std::future_status::ready;
}

/// Waits for the task and returns its result. `work` must be valid, and is invalid afterwards.
template <class T>
[[nodiscard]] Result<T> outcome_of(std::future<Result<T>>& work) {
  try {
    return work.get();
  } catch (const std::exception& error) {
    return fail(ErrorCode::Io, std::string{"internal error: "} + error.what());
  }
}

}  // namespace abbe::daemon
