#pragma once
/// The result of a background task, with an exception converted to an Error.

#include <exception>
#include <future>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

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
