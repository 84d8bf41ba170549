#pragma once
/// Exit codes of all programs (abbed, abbe, abbe-dds, abbe-watch, abbe-sim): one list of numbers
/// and meanings, printed by every --help. Pure; exit_codes_text() allocates.

#include <initializer_list>
#include <string>
#include <string_view>

namespace abbe::protocol {

enum class ExitCode : int {
  Done = 0,
  DataInsufficient = 1,
  Usage = 2,
  BadInput = 3,
  Io = 4,
  Refused = 5,
  StopNotConfirmed = 6,
  StopNotSent = 7,
  Worse = 8,          ///< a model makes the errors of the machine larger
  Internal = 70,      ///< EX_SOFTWARE of sysexits.h: an internal error
  Interrupted = 130,  ///< 128 + SIGINT, as a shell reports it
};

[[nodiscard]] constexpr int number(ExitCode code) noexcept {
  return static_cast<int>(code);
}

/// An exit code of one program. An empty `meaning` means: use the meaning that all programs share.
struct ExitCodeLine {
  ExitCode code = ExitCode::Done;
  std::string_view meaning = {};
};

/// The meaning that all programs share, for example "invalid input file".
[[nodiscard]] std::string_view meaning_of(ExitCode code) noexcept;

/// The text "Exit codes: 0 done; 2 usage; ...", in lines of at most 96 characters, without a last
/// newline.
[[nodiscard]] std::string exit_codes_text(std::initializer_list<ExitCodeLine> lines);

}  // namespace abbe::protocol
