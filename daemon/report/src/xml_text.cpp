#include "xml_text.hpp"

#include <fmt/format.h>

#include <cstdint>

#include "markup.hpp"

namespace abbe::daemon {
namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD", kXmlSpace = " \t\r\n";

/// Number of bytes of the UTF-8 character at the beginning of `text`; 0 if it is not one.
std::size_t character_bytes(std::string_view text) {
  const auto byte = [text](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t first = byte(0);
  if (first < 0x80) return 1;
  const std::size_t bytes = first >= 0xF0 ? 4 : (first >= 0xE0 ? 3 : 2);
  if (first < 0xC2 || first > 0xF4 || text.size() < bytes) return 0;

  std::uint32_t point = first & (0xFFU >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
    point = (point << 6) | (byte(i) & 0x3FU);
  }
  const bool overlong = (bytes == 3 && point < 0x800) || (bytes == 4 && point < 0x10000);
  const bool surrogate = point >= 0xD800 && point <= 0xDFFF;
  return overlong || surrogate || point > 0x10FFFF ? 0 : bytes;
}

bool is_xml_character(std::string_view character) {
  if (character == "\xEF\xBF\xBE" || character == "\xEF\xBF\xBF") return false;  // U+FFFE, U+FFFF
  if (character.size() > 1) return true;
  return static_cast<std::uint8_t>(character[0]) >= 0x20 ||
         kXmlSpace.find(character[0]) != std::string_view::npos;
}

}  // namespace

std::string xml_text(std::string_view text) {
  std::string valid;
  while (!text.empty()) {
    const std::size_t bytes = character_bytes(text);
    const std::string_view character = text.substr(0, bytes == 0 ? 1 : bytes);
    valid += bytes > 0 && is_xml_character(character) ? character : kReplacement;
    text.remove_prefix(character.size());
  }
  const std::size_t first = valid.find_first_not_of(kXmlSpace);
  if (first == std::string::npos) return {};
  return escaped(valid.substr(first, valid.find_last_not_of(kXmlSpace) - first + 1));
}

void XmlText::open(std::string_view name, Attributes attributes) {
  indent();
  text_ += fmt::format("<{}", name);
  for (const auto& [key, value] : attributes)
    text_ += fmt::format(" {}=\"{}\"", key, xml_text(value));
  text_ += ">\n";
  open_.emplace_back(name);
}

void XmlText::close() {
  const std::string name = open_.back();
  open_.pop_back();
  indent();
  text_ += fmt::format("</{}>\n", name);
}

void XmlText::element(std::string_view name, std::string_view text) {
  indent();
  text_ += fmt::format("<{0}>{1}</{0}>\n", name, xml_text(text));
}

void XmlText::element_if(std::string_view name, std::string_view text) {
  if (!xml_text(text).empty()) element(name, text);
}

}  // namespace abbe::daemon
