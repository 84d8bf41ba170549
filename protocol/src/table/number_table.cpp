#include "abbe/protocol/table/number_table.hpp"

#include <algorithm>
#include <limits>
#include <string>

#include "abbe/protocol/printable.hpp"
#include "table/recognition.hpp"
#include "table/text.hpp"

namespace abbe::protocol {

namespace {

constexpr std::size_t kNoColumn = static_cast<std::size_t>(-1);
constexpr std::size_t kProgressRows = 16384;

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

std::string joined(const std::vector<std::string_view>& words, std::string_view between) {
  std::string text;
  for (const std::string_view word : words) {
    if (!text.empty()) text += between;
    text += word;
  }
  return text;
}

std::string quoted(std::string_view text) {
  return '"' + std::string(text) + '"';
}

/// A remark about the content of an invalid cell or column name: it is an error value of a
/// spreadsheet, or has a character that looks like another one or is invisible. Empty if neither
/// applies.
std::string remark(std::string_view text) {
  if (is_spreadsheet_error(text))
    return ", an error value of a spreadsheet: correct the formula, or delete the row";
  const auto strange = strange_character(text);
  return strange.empty() ? strange : ", contains " + strange;
}

/// Text that states the content that the cell with the text `text` should have.
std::string expected(std::string_view text, const std::vector<std::string_view>& words) {
  constexpr std::size_t kFew = 6;
  return words.size() <= kFew ? "must be " + joined(words, " or ")
                              : "unknown" + suggestion(text, words);
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
                 "unknown column" + suggestion(header[i].text, known) + remark(header[i].text));
    else if (seen[column])
      faults.add(line, header[i].column, header[i].text, "column occurs twice");
    else
      seen[column] = true, target[i] = column;
  }

  for (std::size_t column = 0; column < form.size(); ++column)
    if (form[column].required && !seen[column])
      faults.add(line, 1, form[column].name, "missing column; needed: " + joined(known, ","));

  return target;
}

class RowReader {
 public:
  RowReader(const TableForm& form, std::vector<std::size_t> target, Faults& faults)
      : form_(form), target_(std::move(target)), faults_(faults) {}

  void read(std::string_view line, std::size_t number, NumberTable& table) {
    double* const row = table.append(number);
    if (fill(line, row)) return;
    table.mark_invalid();
    if (!recognised_row(line, number, faults_)) add_faults(line, number, row);
  }

 private:
  /// False if the row has a fault.
  [[nodiscard]] bool fill(std::string_view line, double* row) const {
    Cells cutter(line);
    Cell cell;
    std::size_t count = 0;
    for (; cutter.next(cell); ++count)
      if (count >= target_.size() || !fill_cell(cell.text, target_[count], row)) return false;
    return count == target_.size();
  }

  [[nodiscard]] bool fill_cell(std::string_view text, std::size_t column, double* row) const {
    const auto& words = form_[column].words;
    if (text.empty() && form_[column].may_be_empty) {
      row[column] = std::numeric_limits<double>::quiet_NaN();
      return true;
    }
    if (words.empty()) return parse_cell(text, row[column]).empty();
    const auto found = std::find(words.begin(), words.end(), text);
    row[column] = static_cast<double>(found - words.begin());
    return found != words.end();
  }

  void add_faults(std::string_view line, std::size_t number, double* row) {
    Cells cutter(line);
    Cell cell;
    std::size_t count = 0;
    for (; cutter.next(cell); ++count)
      if (count < target_.size()) check_cell(cell, number, target_[count], row);
    if (count != target_.size()) add_count(line, number, count);
  }

  void add_count(std::string_view line, std::size_t number, std::size_t count) {
    auto what = std::to_string(count) + " values, expected " + std::to_string(target_.size());
    const bool commas = count > target_.size() && has_decimal_commas(line, form_, target_.size());
    if (commas)
      what += ", and no decimal point: if commas are the decimal separator, " +
              std::string(kWritePoints);
    faults_.add_kind(commas ? "decimal comma" : "values", number, line.size() + 1, "", what);
  }

  void check_cell(const Cell& cell, std::size_t number, std::size_t column, double* row) {
    if (fill_cell(cell.text, column, row)) return;
    const auto& words = form_[column].words;
    if (!words.empty())
      return faults_.add_kind(
          "word", number, cell.column, form_[column].name,
          quoted(cell.text) + ": " + expected(cell.text, words) + remark(cell.text));
    const auto fault = parse_cell(cell.text, row[column]);
    faults_.add_kind(fault, number, cell.column, form_[column].name,
                     quoted(cell.text) + ": " + std::string(fault) + remark(cell.text));
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
  if (recognised_bytes(text, faults)) return std::nullopt;
  Lines lines(text);
  std::string_view line;
  if (!lines.next(line)) {
    faults.add(1, 1, "", "the file is empty");
    return std::nullopt;
  }

  if (recognised_first_line(line, lines, forms, faults)) return std::nullopt;
  const auto header = all_cells(line);
  const auto index = choose_form(forms, header);
  const auto& form = forms[index];
  auto target = map_header(form, header, lines.number(), faults);
  if (faults.any()) return std::nullopt;  // without this, every row would be reported as a fault

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

}  // namespace abbe::protocol
