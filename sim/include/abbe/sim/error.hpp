#pragma once
/// Errors of the simulator as values. The text states what was tried and what was observed.

#include <string>
#include <tl/expected.hpp>

namespace abbe::sim {

enum class ErrorCode {
  BadInput,  ///< a file or a value is no valid machine, path or configuration
  Io,        ///< the operating system refused an operation on a file or a socket
  Usage,     ///< a required command-line option is missing or malformed
};

struct Error {
  ErrorCode code = ErrorCode::BadInput;
  std::string text;
};

template <class T>
using Result = tl::expected<T, Error>;

[[nodiscard]] inline tl::unexpected<Error> bad_input(std::string text) {
  return tl::unexpected(Error{ErrorCode::BadInput, std::move(text)});
}
[[nodiscard]] inline tl::unexpected<Error> io_error(std::string text) {
  return tl::unexpected(Error{ErrorCode::Io, std::move(text)});
}
[[nodiscard]] inline tl::unexpected<Error> usage_error(std::string text) {
  return tl::unexpected(Error{ErrorCode::Usage, std::move(text)});
}

}  // namespace abbe::sim
