#include "csv.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace abbe::sim {
namespace {

constexpr std::size_t kMostErrors = 20;

std::string_view trimmed(std::string_view s) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t first = s.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return s.substr(first, s.find_last_not_of(kBlank) - first + 1);
}

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  for (std::size_t from = 0; from <= line.size();) {
    const std::size_t comma = std::min(line.find(',', from), line.size());
    cells.push_back(trimmed(line.substr(from, comma - from)));
    from = comma + 1;
  }
  return cells;
}

}  // namespace

void CsvErrors::add(std::size_t line, std::string_view text) {
  if (++count_ > kMostErrors) return;
  text_ += fmt::format("{}{}:{}: {}", text_.empty() ? "" : "\n", name_, line, text);
}

CsvTable split_csv(std::string_view text, CsvErrors& errors) {
  CsvTable table;
  std::size_t number = 0;
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find('\n', from), text.size());
    const std::string_view line = trimmed(text.substr(from, end - from));
    from = end + 1;
    ++number;
    if (line.empty() || line.front() == '#') continue;
    auto cells = cells_of(line);
    if (table.header.empty()) {
      table.header = std::move(cells);
    } else if (cells.size() != table.header.size()) {
      errors.add(number, fmt::format("{} columns, but the header has {}", cells.size(),
                                     table.header.size()));
    } else {
      table.rows.push_back({number, std::move(cells)});
    }
  }

  if (table.header.empty()) errors.add(1, "no header row");
  return table;
}

std::optional<double> csv_number(const CsvTable& table, const CsvRow& row, std::size_t column,
                                 CsvErrors& errors) {
  const std::string_view cell = row.cells[column];
  double value = 0.0;
  const auto [end, code] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (code == std::errc{} && end == cell.data() + cell.size() && std::isfinite(value)) return value;
  errors.add(row.line,
             fmt::format("column {}: \"{}\" is not a number", table.header[column], cell));
  return std::nullopt;
}

}  // namespace abbe::sim
