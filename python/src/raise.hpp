#pragma once

#include <stdexcept>
#include <string>
#include <utility>

#include "abbe/base/error.hpp"

namespace abbe::python {

/// An Error of abbe as a C++ exception; Python receives it as abbe.Error.
struct Raised : std::runtime_error {
  explicit Raised(daemon::Error given) : std::runtime_error(given.text), error(std::move(given)) {}
  daemon::Error error;
};

/// The value of the result; throws the error as Raised.
template <class T>
T value_or_raise(daemon::Result<T> result) {
  if (!result) throw Raised(std::move(result.error()));
  return std::move(*result);
}

}  // namespace abbe::python
