#include "abbe/protocol/ippdme/lines.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "abbe/result/try.hpp"
#include "ippdme/scanner.hpp"

namespace abbe::protocol::ippdme {
namespace {

using Arguments = tl::expected<Argument, LineError>;

tl::expected<int, LineError> whole_number(Scanner& scan, int most) noexcept {
  const auto value = scan.number();
  if (!value || *value < 0.0 || *value > most || *value != static_cast<int>(*value))
    return tl::unexpected(LineError::BadError);
  return static_cast<int>(*value);
}

/// Error(F1,F2,F3,"text"); F3 is the origin of the error, a name or a number chosen by the server.
tl::expected<ErrorReport, LineError> error_report(Scanner& scan) noexcept {
  const auto bad = tl::unexpected(LineError::BadError);
  if (scan.name() != "Error" || !scan.separator('(')) return bad;
  ErrorReport report;
  const auto severity = whole_number(scan, 9);
  if (!severity || !scan.separator(',')) return bad;
  const auto code = whole_number(scan, 9999);
  if (!code || !scan.separator(',')) return bad;
  report.severity = *severity;
  report.code = *code;

  if (const auto quoted = scan.string()) {
    report.origin = *quoted;
  } else {
    const std::string_view from = scan.rest();
    while (!scan.at_end() && scan.peek() != ',' && scan.peek() != ')') (void)scan.take(scan.peek());
    report.origin = {from.data(), from.size() - scan.rest().size()};
  }

  if (!scan.separator(',')) return bad;
  const auto text = scan.string();
  if (!text || !scan.separator(')') || !scan.at_end()) return bad;
  report.text = *text;

  return report;
}

tl::expected<Argument, LineError> property(Scanner& scan, std::string_view name) noexcept {
  Argument a{.kind = Argument::Kind::Property, .text = name};
  if (scan.separator(')')) return a;
  do {
    if (a.count == Argument::kMostNumbers) return tl::unexpected(LineError::BadArgument);
    const auto number = scan.number();
    ABBE_TRY(number);
    a.numbers[a.count++] = *number;
  } while (scan.separator(','));
  if (!scan.separator(')')) return tl::unexpected(LineError::BadArgument);
  return a;
}

tl::expected<Argument, LineError> argument(Scanner& scan) noexcept {
  if (const auto text = scan.string())
    return Argument{.kind = Argument::Kind::String, .text = *text};
  const std::string_view name = scan.name();
  if (!name.empty()) {
    if (scan.separator('(')) return property(scan, name);
    return Argument{.kind = Argument::Kind::Name, .text = name};
  }
  const auto number = scan.number();
  if (!number) return tl::unexpected(LineError::BadArgument);
  return Argument{.kind = Argument::Kind::Number, .numbers = {*number}, .count = 1};
}

bool printable(char c) noexcept {
  return c >= ' ' && c <= '~';
}

}  // namespace

const char* name_of(LineError error) ABBE_RT {
  switch (error) {
    case LineError::IllegalCharacter:
      return "a character outside quotes is not printable ASCII";
    case LineError::TooLong:
      return "a line of more than 65536 characters";
    case LineError::BadTag:
      return "no tag of five digits, or of E and four digits";
    case LineError::NoSpace:
      return "no space after the tag";
    case LineError::BadMarker:
      return "none of & % # ! after the tag";
    case LineError::BadError:
      return "an error that is not Error(severity,code,origin,\"text\")";
    case LineError::BadMethod:
      return "no method with parentheses";
    case LineError::BadArgument:
      return "an argument is not a number, string, name or property";
    case LineError::BadNumber:
      return "an invalid number";
  }
  return "?";
}

tl::expected<Response, LineError> parse_response(std::string_view line) ABBE_RT {
  Scanner scan{line};
  const auto tag = scan.tag();
  if (!tag) return tl::unexpected(LineError::BadTag);
  if (!scan.take(' ')) return tl::unexpected(LineError::NoSpace);

  Response response{.tag = *tag};
  const char marker = scan.peek();
  (void)scan.take(marker);
  switch (marker) {
    case '&':
      response.kind = Response::Kind::Ack;
      break;
    case '%':
      response.kind = Response::Kind::Complete;
      break;
    case '#':
      if (!scan.take(' ')) return tl::unexpected(LineError::BadMarker);
      response.kind = Response::Kind::Data;
      response.data = scan.rest();
      return response;
    case '!': {
      scan.spaces();
      const auto error = error_report(scan);
      ABBE_TRY(error);
      response.kind = Response::Kind::Error;
      response.error = *error;
      return response;
    }
    default:
      return tl::unexpected(LineError::BadMarker);
  }

  scan.spaces();
  if (!scan.at_end()) return tl::unexpected(LineError::BadMarker);
  return response;
}

tl::expected<CommandLine, LineError> parse_command(std::string_view line) ABBE_RT {
  Scanner scan{line};
  const auto tag = scan.tag();
  if (!tag) return tl::unexpected(LineError::BadTag);
  if (!scan.take(' ')) return tl::unexpected(LineError::NoSpace);
  CommandLine command{.tag = *tag};
  command.method = scan.name();
  if (command.method.empty() || !scan.separator('(')) return tl::unexpected(LineError::BadMethod);

  std::string_view inside = scan.rest();
  while (!inside.empty() && inside.back() == ' ') inside.remove_suffix(1);
  if (inside.empty() || inside.back() != ')') return tl::unexpected(LineError::BadMethod);
  inside.remove_suffix(1);

  ArgumentReader reader{inside};
  while (const auto argument = reader.next())
    if (!*argument) return tl::unexpected(argument->error());
  command.arguments = inside;
  return command;
}

std::optional<tl::expected<Argument, LineError>> ArgumentReader::next() ABBE_RT {
  Scanner scan{rest_};
  scan.spaces();
  if (scan.at_end()) {
    rest_ = {};
    return std::nullopt;
  }
  if (!first_ && !scan.separator(',')) {
    rest_ = {};
    return Arguments{tl::unexpected(LineError::BadArgument)};
  }

  first_ = false;
  auto read = argument(scan);
  scan.spaces();

  // After a comma an argument must follow.
  if (read && !scan.at_end() && (scan.peek() != ',' || scan.rest().size() == 1))
    read = tl::unexpected(LineError::BadArgument);
  rest_ = read ? scan.rest() : std::string_view{};

  return read;
}

tl::expected<PointReport, LineError> parse_point(std::string_view data) ABBE_RT {
  PointReport report;
  ArgumentReader reader{data};
  while (const auto argument = reader.next()) {
    if (!*argument) return tl::unexpected(argument->error());

    const Argument& a = **argument;
    if (a.kind != Argument::Kind::Property) continue;
    if (a.text.size() == 1 && a.text[0] >= 'X' && a.text[0] <= 'Z') {
      if (a.count != 1) return tl::unexpected(LineError::BadArgument);
      const auto i = static_cast<std::size_t>(a.text[0] - 'X');
      report.p_mm[i] = a.numbers[0];
      report.known = static_cast<std::uint8_t>(report.known | (1u << i));
    } else if (a.text == "IJK") {
      if (a.count != 3) return tl::unexpected(LineError::BadArgument);
      report.ijk = {a.numbers[0], a.numbers[1], a.numbers[2]};
      report.has_ijk = true;
    }
  }
  return report;
}

std::size_t LineFramer::push(std::span<const std::byte> bytes) ABBE_RT {
  if (begin_ > 0 && kCapacity - end_ < bytes.size()) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    looked_ -= begin_;
    begin_ = 0;
  }
  const std::size_t taken = std::min(bytes.size(), kCapacity - end_);
  if (taken != 0) std::memcpy(buffer_.data() + end_, bytes.data(), taken);
  end_ += taken;
  return taken;
}

tl::unexpected<LineError> LineFramer::refuse(LineError error) ABBE_RT {
  broken_ = true;
  return tl::unexpected(error);
}

std::optional<tl::expected<std::string_view, LineError>> LineFramer::next() ABBE_RT {
  using Line = tl::expected<std::string_view, LineError>;
  if (broken_) {
    begin_ = looked_ = end_ = 0;
    return std::nullopt;
  }
  for (; looked_ < end_; ++looked_) {
    const char c = buffer_[looked_];
    if (c == '\r' && looked_ + 1 == end_) return std::nullopt;  // the LF may arrive later
    if (c == '\r' && buffer_[looked_ + 1] == '\n') {
      const std::string_view line{buffer_.data() + begin_, looked_ - begin_};
      begin_ = looked_ += 2;
      quoted_ = false;
      if (std::exchange(skipping_, false)) {
        --looked_;  // the loop increments it
        continue;
      }
      return Line{line};
    }
    if (skipping_) {
      begin_ = looked_ + 1;
      continue;
    }
    if (c == '"') quoted_ = !quoted_;
    // Between quotes any byte is accepted: servers write texts in the user's language and character
    // set.
    if (!printable(c) && !quoted_) return Line{refuse(LineError::IllegalCharacter)};
    if (looked_ - begin_ >= kMaxLine) return Line{refuse(LineError::TooLong)};
  }

  return std::nullopt;
}

void LineFramer::resume() ABBE_RT {
  if (!broken_) return;
  begin_ = looked_;
  broken_ = quoted_ = false;
  skipping_ = true;
}

void LineFramer::reset() ABBE_RT {
  begin_ = looked_ = end_ = 0;
  broken_ = skipping_ = quoted_ = false;
}

}  // namespace abbe::protocol::ippdme
