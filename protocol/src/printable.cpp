#include "abbe/protocol/printable.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>

namespace abbe::protocol {
namespace {

/// A character of a text, or one byte that is not UTF-8.
struct Character {
  std::uint32_t code = 0;
  std::size_t bytes = 1;
  bool valid = true;
};

bool continues(std::string_view text, std::size_t at) {
  return at < text.size() && (static_cast<unsigned char>(text[at]) & 0xC0u) == 0x80u;
}

/// The character at `at`; the shortest form only, no surrogates, at most U+10FFFF [RFC 3629].
Character character_at(std::string_view text, std::size_t at) {
  const auto first = static_cast<unsigned char>(text[at]);
  if (first < 0x80) return {first};
  const std::size_t bytes = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  constexpr std::array<std::uint32_t, 5> kLeast{0, 0, 0x80, 0x800, 0x10000};
  if (first < 0xC2 || first > 0xF4) return {first, 1, false};

  std::uint32_t code = first & (0x7Fu >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if (!continues(text, at + i)) return {first, 1, false};
    code = code << 6 | (static_cast<unsigned char>(text[at + i]) & 0x3Fu);
  }
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  if (code < kLeast[bytes] || surrogate || code > 0x10FFFF) return {first, 1, false};
  return {code, bytes};
}

struct CodeRange {
  std::uint32_t first, last;
};
// Control characters, and characters that a terminal shows as a blank or not at all [Unicode 15.0:
// general categories Cc, Cf, Zs (without the space), Zl and Zp; Default_Ignorable_Code_Point].
constexpr std::array kUnseen{
    CodeRange{0x00, 0x1F},     CodeRange{0x7F, 0xA0},     CodeRange{0xAD, 0xAD},
    CodeRange{0x34F, 0x34F},   CodeRange{0x600, 0x605},   CodeRange{0x61C, 0x61C},
    CodeRange{0x6DD, 0x6DD},   CodeRange{0x70F, 0x70F},   CodeRange{0x115F, 0x1160},
    CodeRange{0x1680, 0x1680}, CodeRange{0x17B4, 0x17B5}, CodeRange{0x180B, 0x180F},
    CodeRange{0x2000, 0x200F}, CodeRange{0x2028, 0x202F}, CodeRange{0x205F, 0x206F},
    CodeRange{0x2800, 0x2800}, CodeRange{0x3000, 0x3000}, CodeRange{0x3164, 0x3164},
    CodeRange{0xE000, 0xF8FF}, CodeRange{0xFE00, 0xFE0F}, CodeRange{0xFEFF, 0xFEFF},
    CodeRange{0xFFA0, 0xFFA0}, CodeRange{0xFFF0, 0xFFFB}, CodeRange{0xE0000, 0x10FFFF}};

bool is_unseen(std::uint32_t code) {
  return std::ranges::any_of(kUnseen, [code](const CodeRange& range) {
    return code >= range.first && code <= range.last;
  });
}

bool is_visible_ascii(char c) {
  return c >= ' ' && c <= '~';
}

std::string hex_text(const char* format, std::uint32_t code) {
  std::array<char, 16> text{};
  (void)std::snprintf(text.data(), text.size(), format, code);
  return text.data();
}

std::string escape_of(const Character& character) {
  return hex_text(character.valid ? "\\u{%X}" : "\\x%02X", character.code);
}

std::string with_escapes(std::string_view text, bool newline_remains) {
  if (std::ranges::all_of(text, is_visible_ascii)) return std::string(text);
  std::string result;
  for (std::size_t at = 0; at < text.size();) {
    const Character character = character_at(text, at);
    const bool newline = character.code == '\n' && newline_remains;
    const bool visible = character.valid && !is_unseen(character.code);
    result +=
        newline || visible ? std::string(text.substr(at, character.bytes)) : escape_of(character);
    at += character.bytes;
  }
  return result;
}

struct CodeMeaning {
  CodeRange codes;
  std::string_view what;
};
constexpr std::array kMeanings{CodeMeaning{{0x2212, 0x2212}, "minus sign): write \"-\""},
                               CodeMeaning{{0x2010, 0x2015}, "dash): write \"-\""},
                               CodeMeaning{{0xFE63, 0xFE63}, "minus sign): write \"-\""},
                               CodeMeaning{{0xFF0D, 0xFF0D}, "minus sign): write \"-\""},
                               CodeMeaning{{0xFEFF, 0xFEFF}, "byte order mark): delete it"},
                               CodeMeaning{{0xA0, 0xA0}, "no-break space): delete it"},
                               CodeMeaning{{0x2007, 0x2007}, "figure space): delete it"},
                               CodeMeaning{{0x2009, 0x2009}, "thin space): delete it"},
                               CodeMeaning{{0x202F, 0x202F}, "narrow no-break space): delete it"},
                               CodeMeaning{{0x00, 0x1F}, "control character): delete it"},
                               CodeMeaning{{0x7F, 0x9F}, "control character): delete it"}};

}  // namespace

std::string without_control_characters(std::string_view text) {
  if (std::ranges::all_of(text, is_visible_ascii)) return std::string(text);
  std::string result;
  for (std::size_t at = 0; at < text.size();) {
    const Character character = character_at(text, at);
    const bool control = character.code < ' ' || (character.code >= 0x7F && character.code < 0xA0);
    result += control && character.valid && character.code != '\n'
                  ? escape_of(character)
                  : std::string(text.substr(at, character.bytes));
    at += character.bytes;
  }
  return result;
}

std::string printable(std::string_view text) {
  return with_escapes(text, true);
}

std::string printable_line(std::string_view text) {
  return with_escapes(text, false);
}

std::string strange_character(std::string_view text) {
  const auto found = std::ranges::find_if_not(text, is_visible_ascii);
  if (found == text.end()) return {};
  const auto character = character_at(text, static_cast<std::size_t>(found - text.begin()));
  if (!character.valid)
    return "byte " + hex_text("0x%02X", character.code) + ", which is not UTF-8";

  const std::string name = hex_text("U+%04X", character.code);
  for (const auto& [codes, what] : kMeanings)
    if (character.code >= codes.first && character.code <= codes.last)
      return name + " (" + std::string(what);
  return name + (is_unseen(character.code) ? ", which is not visible: delete it" : "");
}

}  // namespace abbe::protocol
