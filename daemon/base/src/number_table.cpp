#include "abbe/base/number_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace abbe::daemon {

namespace {

constexpr std::size_t kNoColumn = static_cast<std::size_t>(-1);
constexpr std::size_t kProgressRows = 16384;

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r';
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// Iterates over the lines of a text and counts them; skips comments and blank lines.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;  // byte order mark
  }

  /// False at the end of the text. Then ended() is false if the last line has no newline.
  bool next(std::string_view& line) {
    while (at_ < text_.size()) {
      const auto newline = text_.find('\n', at_);
      ended_ = newline != std::string_view::npos;
      line = text_.substr(at_, ended_ ? newline - at_ : std::string_view::npos);
      at_ += line.size() + 1;
      ++number_;
      const auto content = trimmed(line);
      if (!content.empty() && content.front() != '#') return true;
    }
    return false;
  }
  [[nodiscard]] std::size_t number() const noexcept { return number_; }
  [[nodiscard]] bool ended() const noexcept { return ended_; }
  [[nodiscard]] double fraction() const {
    return static_cast<double>(std::min(at_, text_.size())) / static_cast<double>(text_.size());
  }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
  std::size_t number_ = 0;
  bool ended_ = true;
};

struct Cell {
  std::string_view text;
  std::size_t column = 1;  // of the first character, counted from 1
};

/// Iterates over the cells of a line; next() returns false after the last one.
class Cells {
 public:
  explicit Cells(std::string_view line) : line_(line) {}
  bool next(Cell& cell) {
    if (at_ > line_.size()) return false;
    const auto comma = std::min(line_.find(',', at_), line_.size());
    const auto raw = line_.substr(at_, comma - at_);
    cell.text = trimmed(raw);
    cell.column =
        1 + static_cast<std::size_t>(cell.text.empty() ? at_ : cell.text.data() - line_.data());
    at_ = comma + 1;
    return true;
  }

 private:
  std::string_view line_;
  std::size_t at_ = 0;
};

std::vector<Cell> all_cells(std::string_view line) {
  std::vector<Cell> cells;
  Cells cutter(line);
  for (Cell cell; cutter.next(cell);) cells.push_back(cell);
  return cells;
}

std::size_t count_present(const TableForm& form, const std::vector<Cell>& header) {
  return static_cast<std::size_t>(
      std::count_if(header.begin(), header.end(), [&](const Cell& cell) {
        return std::any_of(form.begin(), form.end(),
                           [&](const auto& rule) { return rule.name == cell.text; });
      }));
}

/// The form with the most columns in this header. Faults are then reported against this form.
std::size_t choose_form(const std::vector<TableForm>& forms, const std::vector<Cell>& header) {
  const auto best = std::max_element(forms.begin(), forms.end(), [&](const auto& a, const auto& b) {
    return count_present(a, header) < count_present(b, header);
  });
  return static_cast<std::size_t>(best - forms.begin());
}

std::vector<std::string_view> names(const TableForm& form) {
  std::vector<std::string_view> result;
  for (const auto& rule : form) result.push_back(rule.name);
  return result;
}

/// For each cell of a row, the index of its column in the form.
std::vector<std::size_t> map_header(const TableForm& form, const std::vector<Cell>& header,
                                    std::size_t line, Faults& faults) {
  const auto known = names(form);
  std::vector<std::size_t> target(header.size(), kNoColumn);
  std::vector<bool> seen(form.size(), false);

  for (std::size_t i = 0; i < header.size(); ++i) {
    const auto found = std::find(known.begin(), known.end(), header[i].text);
    const auto column = static_cast<std::size_t>(found - known.begin());
    if (found == known.end())
      faults.add(line, header[i].column, header[i].text,
                 "unknown column" + suggestion(header[i].text, known));
    else if (seen[column])
      faults.add(line, header[i].column, header[i].text, "column occurs twice");
    else
      seen[column] = true, target[i] = column;
  }

  for (std::size_t column = 0; column < form.size(); ++column)
    if (form[column].required && !seen[column])
      faults.add(line, 1, form[column].name,
                 fmt::format("missing column; needed: {}", fmt::join(known, ",")));

  return target;
}

/// Sets `value`. Returns what is wrong with the cell; empty if it is valid.
std::string_view parse_cell(std::string_view text, double& value) {
  if (text.empty()) return "empty";
  // Spreadsheets write "+"; std::from_chars does not accept it.
  if (text.front() == '+') text.remove_prefix(1);
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault == std::errc::result_out_of_range) return "out of range";
  if (fault != std::errc{} || end != text.data() + text.size()) return "not a number";
  if (!std::isfinite(value)) return "must be finite";
  return {};
}

class RowReader {
 public:
  RowReader(const TableForm& form, std::vector<std::size_t> target, Faults& faults)
      : form_(form), target_(std::move(target)), faults_(faults) {}

  void read(std::string_view line, std::size_t number, NumberTable& table) {
    double* const row = table.append(number);
    const auto faults_before = faults_.count();
    Cells cutter(line);
    Cell cell;
    std::size_t count = 0;
    for (; cutter.next(cell); ++count)
      if (count < target_.size()) read_cell(cell, number, target_[count], row);
    if (count != target_.size())
      faults_.add(number, line.size() + 1, "",
                  fmt::format("{} values, expected {}", count, target_.size()));
    if (faults_.count() != faults_before) table.mark_invalid();
  }

 private:
  void read_word(const Cell& cell, std::size_t number, std::size_t column, double* row) {
    const auto& words = form_[column].words;
    const auto found = std::find(words.begin(), words.end(), cell.text);
    row[column] = static_cast<double>(found - words.begin());
    if (found == words.end())
      faults_.add(number, cell.column, form_[column].name,
                  fmt::format("\"{}\": must be {}", cell.text, fmt::join(words, " or ")));
  }

  void read_cell(const Cell& cell, std::size_t number, std::size_t column, double* row) {
    if (!form_[column].words.empty()) return read_word(cell, number, column, row);
    const auto fault = parse_cell(cell.text, row[column]);
    if (!fault.empty())
      faults_.add(number, cell.column, form_[column].name,
                  fmt::format("\"{}\": {}", cell.text, fault));
  }

  const TableForm& form_;
  std::vector<std::size_t> target_;
  Faults& faults_;
};

void check_end(const Lines& lines, std::string_view last, Faults& faults) {
  if (!lines.ended())
    faults.add(lines.number(), last.size() + 1, "",
               "the last line does not end with a newline: the file may be cut off (if it is "
               "complete, add a newline)");
}

}  // namespace

double* NumberTable::append(std::size_t line) {
  lines_.push_back(static_cast<std::uint32_t>(line));
  sound_.push_back(true);
  values_.resize(values_.size() + width(), 0.0);
  return values_.data() + values_.size() - width();
}

void NumberTable::reserve(std::size_t rows) {
  values_.reserve(rows * width());
  lines_.reserve(rows);
}

std::optional<NumberTable> parse_numbers(std::string_view text, const std::vector<TableForm>& forms,
                                         Faults& faults, const ReadProgress& progress) {
  Lines lines(text);
  std::string_view line;
  if (!lines.next(line)) {
    faults.add(1, 1, "", "the file is empty");
    return std::nullopt;
  }

  const auto header = all_cells(line);
  const auto index = choose_form(forms, header);
  const auto& form = forms[index];
  auto target = map_header(form, header, lines.number(), faults);
  if (faults.any()) return std::nullopt;  // every row would be reported as a fault

  std::vector<bool> present(form.size(), false);
  for (const auto column : target) present[column] = true;
  NumberTable table(index, std::move(present));
  table.reserve(text.size() / (line.size() + 1));
  RowReader reader(form, std::move(target), faults);

  auto last = line;
  while (lines.next(line)) {
    reader.read(line, lines.number(), table);
    last = line;
    if (progress && table.rows() % kProgressRows == 0) progress(lines.fraction());
  }
  check_end(lines, last, faults);
  if (progress) progress(1.0);

  return table;
}

}  // namespace abbe::daemon
