#pragma once
/// Builds the text of XML elements, indented.

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace abbe::daemon {

/// Any bytes as text for XML 1.0. Special characters are escaped; bytes that are not UTF-8 and
/// characters that XML does not allow are replaced by U+FFFD; white space at both ends is removed.
[[nodiscard]] std::string xml_text(std::string_view text);

class XmlText {
 public:
  using Attributes = std::initializer_list<std::pair<std::string_view, std::string_view>>;

  XmlText() : text_("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n") {}
  void open(std::string_view name, Attributes attributes = {});
  void close();
  void element(std::string_view name, std::string_view text);
  /// Writes the element; nothing for an empty text.
  void element_if(std::string_view name, std::string_view text);
  /// The whole text. Requires that every element is closed.
  [[nodiscard]] std::string finish() const { return text_; }

 private:
  void indent() { text_.append(2 * open_.size(), ' '); }

  std::string text_;
  std::vector<std::string> open_;
};

}  // namespace abbe::daemon
