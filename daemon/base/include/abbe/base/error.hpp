#pragma once
/// The daemon's errors: a code for programs and a sentence for people, in the form
/// "what was tried: what was seen".

#include <string>
#include <tl/expected.hpp>
#include <utility>
#include <vector>

#include "abbe/protocol/exit_codes.hpp"

namespace abbe::daemon {

enum class ErrorCode {
  DataInsufficient,  ///< too few points, a singular fit, lost samples: there is no result
  Usage,             ///< a command was called wrongly
  BadInput,          ///< a file, message or configuration is invalid
  Io,                ///< a call to the operating system failed: file, socket, process
  Refused,           ///< the request is valid, but a check or the present state forbids it
  StopNotConfirmed,  ///< AbortE was sent to a measuring machine, but not answered, or refused
  StopNotSent,       ///< there is no connection to the measuring machine: AbortE was not sent
};

struct Error {
  ErrorCode code = ErrorCode::BadInput;
  std::string text;
  /// further lines of the message, for example one for each fault of a file
  std::vector<std::string> details = {};
};

template <class T>
using Result = tl::expected<T, Error>;

[[nodiscard]] inline tl::unexpected<Error> fail(ErrorCode code, std::string text) {
  return tl::make_unexpected(Error{code, std::move(text)});
}

/// Exit code of a program that ends with an error of this code; never 0. The --help text of every
/// program lists the exit codes.
[[nodiscard]] constexpr int exit_code(ErrorCode code) noexcept {
  switch (code) {
    case ErrorCode::DataInsufficient:
      return number(protocol::ExitCode::DataInsufficient);
    case ErrorCode::Usage:
      return number(protocol::ExitCode::Usage);
    case ErrorCode::BadInput:
      return number(protocol::ExitCode::BadInput);
    case ErrorCode::Io:
      return number(protocol::ExitCode::Io);
    case ErrorCode::Refused:
      return number(protocol::ExitCode::Refused);
    case ErrorCode::StopNotConfirmed:
      return number(protocol::ExitCode::StopNotConfirmed);
    case ErrorCode::StopNotSent:
      return number(protocol::ExitCode::StopNotSent);
  }

  return number(protocol::ExitCode::Io);
}

}  // namespace abbe::daemon
