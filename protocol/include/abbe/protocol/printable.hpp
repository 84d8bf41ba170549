#pragma once
/// Makes text of unknown origin (cells, file names, configuration, devices, network) readable, and
/// safe for a terminal, which could execute control sequences in it. Pure; thread-safe.

#include <string>
#include <string_view>

namespace abbe::protocol {

/// `text` with every character that is not visible as an escape: a control character or an
/// invisible one (no-break space, zero width space, byte order mark, direction marks) as
/// "\u{200B}", a byte that is not UTF-8 as "\xFC". A newline remains. Applying the function twice
/// changes nothing more.
[[nodiscard]] std::string printable(std::string_view text);

/// Same as printable(), but a newline is written as "\u{A}": for one line of a log.
[[nodiscard]] std::string printable_line(std::string_view text);

/// `text` with every control character except a newline as an escape. Other characters remain, also
/// invisible ones. For text that is also used as data, such as the name of a file.
[[nodiscard]] std::string without_control_characters(std::string_view text);

/// The first character of `text` that is not printable ASCII, with the remedy: "U+2212 (minus
/// sign): write \"-\"". Empty if there is none.
[[nodiscard]] std::string strange_character(std::string_view text);

}  // namespace abbe::protocol
