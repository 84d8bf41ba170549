#pragma once
/// Exit codes of all programs of the daemon: one list of numbers, printed by every --help.
/// exit_code() of error.hpp gives the number of an ErrorCode; it uses the same numbers.

#include <initializer_list>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

enum class ExitCode : int {
  Done = 0,
  DataInsufficient = 1,
  Usage = 2,
  BadInput = 3,
  Io = 4,
  Refused = 5,
  Internal = 70,      ///< EX_SOFTWARE of sysexits.h: an internal error
  Interrupted = 130,  ///< 128 + SIGINT, as a shell reports it
};

[[nodiscard]] constexpr int number(ExitCode code) noexcept {
  return static_cast<int>(code);
}

static_assert(exit_code(ErrorCode::DataInsufficient) == number(ExitCode::DataInsufficient));
static_assert(exit_code(ErrorCode::Usage) == number(ExitCode::Usage));
static_assert(exit_code(ErrorCode::BadInput) == number(ExitCode::BadInput));
static_assert(exit_code(ErrorCode::Io) == number(ExitCode::Io));
static_assert(exit_code(ErrorCode::Refused) == number(ExitCode::Refused));

/// An exit code of one program. `meaning` empty: the meaning that all programs share.
struct ExitCodeLine {
  ExitCode code = ExitCode::Done;
  std::string_view meaning = {};
};

/// The meaning that all programs share, for example "invalid input file".
[[nodiscard]] std::string_view meaning_of(ExitCode code) noexcept;

/// "Exit codes: 0 done; 2 usage; ...", in lines of at most 96 characters, without a last newline.
[[nodiscard]] std::string exit_codes_text(std::initializer_list<ExitCodeLine> lines);

}  // namespace abbe::daemon
