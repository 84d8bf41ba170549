#include "abbe/protocol/exit_codes.hpp"

#include <cstddef>

namespace abbe::protocol {
namespace {

constexpr std::size_t kWidth = 96;

/// `text` with newlines instead of spaces where a line would be longer than kWidth.
std::string wrapped(std::string text) {
  std::size_t line = 0, space = std::string::npos;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (i - line >= kWidth && space != std::string::npos) {
      text[space] = '\n';
      line = space + 1;
      space = std::string::npos;
    }
    if (text[i] == ' ') space = i;
  }
  return text;
}

}  // namespace

std::string_view meaning_of(ExitCode code) noexcept {
  switch (code) {
    case ExitCode::Done:
      return "done";
    case ExitCode::DataInsufficient:
      return "the data do not allow an answer (rank, alignment, too few points)";
    case ExitCode::Usage:
      return "usage";
    case ExitCode::BadInput:
      return "invalid input file";
    case ExitCode::Io:
      return "input or output failed";
    case ExitCode::Refused:
      return "refused by the gate, or because of a state";
    case ExitCode::StopNotConfirmed:
      return "the stop of the measuring machine is not confirmed: it may be moving";
    case ExitCode::StopNotSent:
      return "no stop could be sent to the measuring machine: it may be moving";
    case ExitCode::Worse:
      return "worse with the model than without it: do not use the model";
    case ExitCode::Internal:
      return "internal error";
    case ExitCode::Interrupted:
      return "interrupted";
  }
  return "internal error";
}

std::string exit_codes_text(std::initializer_list<ExitCodeLine> lines) {
  std::string text = "Exit codes:";
  for (const auto& line : lines) {
    text += ' ' + std::to_string(number(line.code)) + ' ';
    text += line.meaning.empty() ? meaning_of(line.code) : line.meaning;
    text += ';';
  }
  text.back() = '.';
  return wrapped(std::move(text));
}

}  // namespace abbe::protocol
