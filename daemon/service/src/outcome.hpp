#pragma once
/// What came of work on another thread, an exception as an Error.

#include <exception>
#include <future>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// `work` is valid; waits for it, and leaves it invalid.
template <class T>
[[nodiscard]] Result<T> outcome_of(std::future<Result<T>>& work) {
  try {
    return work.get();
  } catch (const std::exception& defect) {
    return fail(ErrorCode::Io, std::string{"defect: "} + defect.what());
  }
}

}  // namespace abbe::daemon
