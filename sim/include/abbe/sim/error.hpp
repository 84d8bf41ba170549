#pragma once
/// What can go wrong in the simulator, as a value. The text says what was tried and what was seen.

#include <string>
#include <tl/expected.hpp>

namespace abbe::sim {

enum class ErrorCode {
  BadInput,  ///< a file or a value that makes no machine, path or configuration
  Io,        ///< a file or a socket that the system refuses
  Usage,     ///< a command line that leaves out what cannot be guessed
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
