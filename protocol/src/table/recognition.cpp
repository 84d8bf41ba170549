#include "table/recognition.hpp"

#include <array>
#include <optional>
#include <string>

namespace abbe::protocol {
namespace {

struct Signature {
  std::string_view bytes, what;
};

constexpr std::string_view kUtf16 = "the file is UTF-16: save it as \"CSV UTF-8\"";
constexpr std::array kSignatures{
    Signature{"\xFF\xFE", kUtf16}, Signature{"\xFE\xFF", kUtf16},
    Signature{
        "\xEF\xBB\xBF\xEF\xBB\xBF",
        "two byte order marks (U+FEFF) at the beginning: delete them, or save the file as UTF-8 "
        "without a byte order mark"},
    Signature{"PK\x03\x04", "a spreadsheet file (.xlsx, .ods), not CSV: save it as \"CSV UTF-8\""},
    Signature{"\xD0\xCF\x11\xE0", "a spreadsheet file (.xls), not CSV: save it as \"CSV UTF-8\""}};

constexpr std::string_view kQuoted =
    "quotation marks around values: write the values without them (in a spreadsheet: export with "
    "no text delimiter)";

struct Separator {
  char sign;
  std::string_view name;
};
constexpr std::array kSeparators{Separator{';', "semicolons"}, Separator{'\t', "tabs"},
                                 Separator{' ', "spaces"}};

std::string separated_by(const Separator& separator) {
  const std::string name(separator.name);
  return name +
         " separate the values: write commas (in a spreadsheet: export as CSV with field separator "
         "\",\"; in a text editor: first make decimal commas points, then replace the " +
         name + " by commas)";
}

std::string_view unquoted(std::string_view cell) {
  while (cell.starts_with('"')) cell.remove_prefix(1);
  while (cell.ends_with('"')) cell.remove_suffix(1);
  return trimmed(cell);
}

bool is_number(std::string_view cell) {
  double value = 0.0;
  return parse_cell(cell, value).empty();
}

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// True for "0,5". False for "0,": that is a value followed by a comma and a space.
bool has_decimal_comma(std::string_view cell) {
  const auto comma = cell.find(',');
  if (comma == 0 || comma >= cell.size() - 1 || cell.find('.') != std::string_view::npos)
    return false;
  if (!is_digit(cell[comma - 1]) || !is_digit(cell[comma + 1])) return false;
  std::string pointed(cell);
  pointed[comma] = '.';
  return is_number(pointed);
}

bool is_column(std::string_view cell, const std::vector<TableForm>& forms) {
  for (const auto& form : forms)
    for (const auto& rule : form)
      if (rule.name == cell) return true;
  return false;
}

bool is_word(std::string_view cell, const TableForm& form) {
  for (const auto& rule : form)
    if (std::find(rule.words.begin(), rule.words.end(), cell) != rule.words.end()) return true;
  return false;
}

bool is_value(std::string_view cell, const std::vector<TableForm>& forms) {
  if (is_number(cell) || has_decimal_comma(cell)) return true;
  return std::any_of(forms.begin(), forms.end(),
                     [&](const TableForm& form) { return is_word(cell, form); });
}

/// Cells of a line, without their quotation marks. If the separator is a space, several spaces
/// count as one separator.
std::vector<Cell> unquoted_cells(std::string_view line, char separator) {
  auto cells = all_cells(line, separator);
  if (separator == ' ') std::erase_if(cells, [](const Cell& cell) { return cell.text.empty(); });
  for (Cell& cell : cells) cell.text = unquoted(cell.text);
  return cells;
}

/// True if the line consists of column names or values that are separated by `separator`, and not
/// by commas.
bool is_separated_by(char separator, std::string_view line, const std::vector<TableForm>& forms) {
  const auto cells = unquoted_cells(trimmed(line), separator);
  if (cells.size() < 2) return false;
  bool any_column = false, all_values = true;
  for (const Cell& cell : cells) {
    const bool value = is_value(cell.text, forms);
    if (!value && cell.text.find(',') != std::string_view::npos) return false;
    any_column = any_column || is_column(cell.text, forms);
    all_values = all_values && value;
  }
  return any_column || all_values;
}

std::optional<Separator> separator_of(std::string_view line, const std::vector<TableForm>& forms) {
  for (const Separator& separator : kSeparators)
    if (is_separated_by(separator.sign, line, forms)) return separator;
  return std::nullopt;
}

/// Text of a header line, "x_mm,y_mm,z_mm": the names of the first `columns` columns of the form,
/// and of the required columns that follow them.
std::string header_of(const TableForm& form, std::size_t columns) {
  std::string header;
  for (std::size_t i = 0; i < form.size(); ++i) {
    if (i >= columns && !form[i].required) break;
    header += (i == 0 ? "" : ",") + std::string(form[i].name);
  }
  return header;
}

void add_missing_header(std::size_t line, std::size_t columns, const std::vector<TableForm>& forms,
                        Faults& faults) {
  std::string headers;
  for (const TableForm& form : forms)
    headers += (headers.empty() ? "" : "  or  ") + header_of(form, columns);
  faults.add(line, 1, "",
             "the header line is missing: insert a line with the names of the columns, in their "
             "order, before this one: " +
                 headers);
}

/// True for a line that contains only values.
bool has_no_names(const std::vector<Cell>& cells, const std::vector<TableForm>& forms) {
  return std::all_of(cells.begin(), cells.end(),
                     [&](const Cell& cell) { return is_value(cell.text, forms); });
}

void add_decimal_commas(std::string_view line, std::size_t number, char separator, Faults& faults) {
  for (const Cell& cell : unquoted_cells(line, separator)) {
    if (!has_decimal_comma(cell.text)) continue;
    faults.add_kind(
        "decimal comma", number, cell.column, "",
        '"' + std::string(cell.text) + "\" has a decimal comma: " + std::string(kWritePoints));
    return;
  }
}

void add_separator(const Separator& separator, std::string_view first, Lines lines,
                   Faults& faults) {
  const std::size_t column = 1 + first.find(separator.sign);
  faults.add(lines.number(), column, "", separated_by(separator));
  auto line = first;
  do add_decimal_commas(line, lines.number(), separator.sign, faults);
  while (lines.next(line));
}

}  // namespace

bool recognised_bytes(std::string_view text, Faults& faults) {
  for (const auto& [bytes, what] : kSignatures) {
    if (!text.starts_with(bytes)) continue;
    faults.add(1, 1, "", what);
    return true;
  }
  return false;
}

bool recognised_first_line(std::string_view first, Lines lines, const std::vector<TableForm>& forms,
                           Faults& faults) {
  const auto separator = separator_of(first, forms);
  const auto cells = unquoted_cells(trimmed(first), separator ? separator->sign : ',');
  if (const auto quote = first.find('"'); quote != std::string_view::npos)
    faults.add(lines.number(), 1 + quote, "", kQuoted);
  if (has_no_names(cells, forms)) add_missing_header(lines.number(), cells.size(), forms, faults);
  if (separator) add_separator(*separator, first, lines, faults);
  return faults.any();
}

bool recognised_row(std::string_view line, std::size_t number, Faults& faults) {
  if (const auto quote = line.find('"'); quote != std::string_view::npos) {
    faults.add(number, 1 + quote, "", kQuoted);
    return true;
  }

  const auto content = trimmed(line);
  for (const Separator& separator : kSeparators) {
    const bool instead = separator.sign == ';' || content.find(',') == std::string_view::npos;
    const auto at = content.find(separator.sign);
    if (!instead || at == std::string_view::npos) continue;
    const auto before = static_cast<std::size_t>(content.data() - line.data());
    faults.add(number, before + at + 1, "", separated_by(separator));
    return true;
  }
  return false;
}

bool has_decimal_commas(std::string_view line, const TableForm& form, std::size_t columns) {
  const auto cells = all_cells(line);
  const std::size_t most_cells = 2 * columns;  // a decimal comma in every value
  if (cells.size() > most_cells || line.find('.') != std::string_view::npos) return false;
  return std::all_of(cells.begin(), cells.end(), [&](const Cell& cell) {
    return is_number(cell.text) || is_word(cell.text, form);
  });
}

}  // namespace abbe::protocol
