#pragma once
/// The daemon's errors: a code a program can act on and a sentence a person can, "what was tried: what was
/// seen".

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace abbe::daemon {

enum class ErrorCode {
  DataInsufficient,  ///< the data do not allow an answer (rank, alignment, too few points)
  Usage,             ///< a command was called wrongly
  BadInput,          ///< a file, message or configuration is not what it should be
  Io,                ///< the operating system refused: file, socket, process
  Refused,           ///< the gate, or the present state, does not allow it
};

struct Error {
  ErrorCode code = ErrorCode::BadInput;
  std::string text;
};

template <class T>
using Result = tl::expected<T, Error>;

[[nodiscard]] inline tl::unexpected<Error> fail(ErrorCode code, std::string text) {
  return tl::make_unexpected(Error{code, std::move(text)});
}

}  // namespace abbe::daemon
