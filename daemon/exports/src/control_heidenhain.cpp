// HEIDENHAIN MANUALplus 620 Technical Manual p. 716, 718: .COM tables and config.cma.
#include <fmt/format.h>

#include <algorithm>

#include "abbe/result/try.hpp"
#include "control_tables.hpp"

namespace abbe::daemon {
namespace {

struct TextTable {
  std::vector<std::string_view> columns;
  /// each row with its line number
  std::vector<std::pair<std::size_t, std::vector<std::string_view>>> rows;
};

/// One column of a .COM table.
struct AxisFunction {
  std::size_t input = 0, output = 0;
  std::vector<TablePoint> points;
};

Result<TextTable> text_table(const ExportFile& file) {
  TextTable table;
  bool ended = false;
  for (const TextLine& line : lines_of(file.text, "")) {
    auto words = words_of(line.text);
    if (words.empty()) continue;
    if (ended) return at_line(file.name, line.number, "text after [END]");
    if (words.front() == "[END]") {
      ended = true;
    } else if (table.columns.empty()) {
      table.columns = std::move(words);
    } else if (words.size() != table.columns.size()) {
      return at_line(file.name, line.number,
                     fmt::format("{} values for {} columns", words.size(), table.columns.size()));
    } else {
      table.rows.emplace_back(line.number, std::move(words));
    }
  }
  if (!ended) return at_line(file.name, 1, "the table does not end with [END]");
  return table;
}

Result<std::vector<double>> numbers_of(const ExportFile& file, const TextTable& table,
                                       std::size_t column) {
  std::vector<double> numbers;
  for (const auto& [line, words] : table.rows) {
    const auto number = plain_number(words[column]);
    if (!number)
      return at_line(file.name, line, fmt::format("\"{}\" is not a number", words[column]));
    numbers.push_back(*number);
  }
  return numbers;
}

/// Appends the columns of a .COM table that belongs to axis `input`.
Result<void> add_functions(const ExportFile& file, std::size_t input,
                           const ControlSettings& settings, std::vector<AxisFunction>& functions) {
  const auto table = text_table(file);
  ABBE_TRY(table);
  if (table->columns.size() < 2 || table->columns[0] != "NR" || table->columns[1] != "AXISPOS")
    return at_line(file.name, 1, "the first columns must be NR and AXISPOS");
  const auto positions = numbers_of(file, *table, 1);
  ABBE_TRY(positions);

  for (std::size_t column = 2; column < table->columns.size(); ++column) {
    const auto output = axis_named(settings, table->columns[column]);
    if (!output) return at_line(file.name, 1, "a column is not an axis of the control");
    const auto values = numbers_of(file, *table, column);
    ABBE_TRY(values);

    AxisFunction function{input, *output, {}};
    for (std::size_t i = 0; i < values->size(); ++i)
      function.points.push_back({(*positions)[i], (*values)[i]});
    if (const auto fault = table_fault(function.points); !fault.empty())
      return at_line(file.name, 1, fault);
    functions.push_back(std::move(function));
  }
  return {};
}

/// The active row of config.cma.
const std::vector<std::string_view>* active_row(const TextTable& table) {
  if (table.columns.size() < 2 || table.columns[1] != "ACTIVE") return nullptr;
  const std::vector<std::string_view>* active = nullptr;
  for (const auto& [line, words] : table.rows) {
    if (words[1] == "*" && active == nullptr) active = &words;
  }
  return active;
}

}  // namespace

Result<ControlCorrection> read_com_tables(std::span<const ExportFile> files,
                                          const ControlSettings& settings) {
  const auto find = [&](std::string_view name) {
    return std::find_if(files.begin(), files.end(),
                        [&](const ExportFile& file) { return file.name == name; });
  };
  const auto cma = find("config.cma");
  if (cma == files.end()) return at_line("config.cma", 0, "the file is missing");
  const auto assignment = text_table(*cma);
  ABBE_TRY(assignment);
  const auto* row = active_row(*assignment);
  if (row == nullptr) return at_line(cma->name, 1, "no row is active");

  std::vector<AxisFunction> functions;
  for (std::size_t column = 2; column < row->size(); ++column) {
    const auto input = axis_named(settings, assignment->columns[column]);
    const auto file = find((*row)[column]);
    if (!input || file == files.end())
      return at_line(cma->name, 1, fmt::format("table {} or its axis is missing", (*row)[column]));
    ABBE_TRY(add_functions(*file, *input, settings, functions));
  }

  const double sign = settings.positive_moves;
  return [functions, sign](const AxisPosition& commanded_m, const std::array<int, 3>&) {
    AxisPosition c_m{};
    for (const AxisFunction& function : functions) {
      const double value = on_table(function.points, commanded_m[function.input] * 1000.0);
      c_m[function.output] += sign * value / 1000.0;
    }
    return c_m;
  };
}

}  // namespace abbe::daemon
