#include "toml_nesting.hpp"

#include <algorithm>
#include <vector>

namespace abbe::sections {
namespace {

/// Tracks the nesting depth of a TOML text. The decimal point of a number is counted like a dot of
/// a key: the result is then too large by one.
class TomlNesting {
 public:
  explicit TomlNesting(std::string_view text) : text_(text) {}

  /// Offset of the byte at which the nesting depth first exceeds `most`.
  std::optional<std::size_t> exceeds(std::size_t most) {
    while (at_ < text_.size()) {
      step();
      if (depth() > most) return at_ - 1;
    }
    return std::nullopt;
  }

 private:
  [[nodiscard]] std::size_t depth() const { return header_ + open_.size() + dots_in_all_; }

  void step() {
    const char c = text_[at_];
    const bool line_begins = line_begins_ && open_.size() == 1;
    if (c != ' ' && c != '\t') line_begins_ = false;
    if (c == '"' || c == '\'') return skip_string(c);
    if (c == '#') return skip_comment();
    ++at_;

    if (line_begins && c == '[') {
      begin_header();
    } else if (c == '\n') {
      end_line();
    } else if (c == '.') {
      ++(in_header_ ? header_ : open_.back());
      if (!in_header_) ++dots_in_all_;
    } else if (!in_header_) {
      step_in_value(c);
    }
  }

  void step_in_value(char c) {
    if (c == '[' || c == '{') {
      open_.push_back(0);
    } else if (c == ',') {
      forget_dots();
    } else if ((c == ']' || c == '}') && open_.size() > 1) {
      forget_dots();
      open_.pop_back();
    }
  }

  void begin_header() {
    in_header_ = true;
    header_ = 2;  // counted as an array of tables, the deeper case
    forget_dots();
  }

  void end_line() {
    in_header_ = false;
    line_begins_ = true;
    forget_dots();
  }

  void forget_dots() {
    dots_in_all_ -= open_.back();
    open_.back() = 0;
  }

  void skip_comment() { at_ = std::min(text_.find('\n', at_), text_.size()); }

  void skip_string(char quote) {
    const std::string_view rest = text_.substr(at_);
    const bool multi_line = rest.size() >= 3 && rest[1] == quote && rest[2] == quote;
    at_ += multi_line ? 3 : 1;

    for (; at_ < text_.size(); ++at_) {
      if (text_[at_] == '\\' && quote == '"') {
        ++at_;
      } else if (!multi_line && text_[at_] == '\n') {
        return;  // not closed: the parser reports the error
      } else if (text_[at_] == quote && (!multi_line || closes(quote))) {
        // In a multi-line string up to two quotes may precede the closing three.
        return pass_quotes(quote, multi_line ? 5 : 1);
      }
    }

    at_ = text_.size();
  }

  [[nodiscard]] bool closes(char quote) const {
    const std::string_view three = text_.substr(at_, 3);
    return three.size() == 3 && three[1] == quote && three[2] == quote;
  }

  void pass_quotes(char quote, int most) {
    for (int i = 0; i < most && at_ < text_.size() && text_[at_] == quote; ++i) ++at_;
  }

  std::string_view text_;
  std::size_t at_ = 0;
  bool line_begins_ = true;
  bool in_header_ = false;
  std::size_t header_ = 0;  // levels of the present table name
  // One entry for each open array or inline table: the number of dots in its current key.
  std::vector<std::size_t> open_ = {0};
  std::size_t dots_in_all_ = 0;
};

}  // namespace

std::optional<std::size_t> toml_deeper_than(std::string_view text, std::size_t most) {
  return TomlNesting{text}.exceeds(most);
}

}  // namespace abbe::sections
