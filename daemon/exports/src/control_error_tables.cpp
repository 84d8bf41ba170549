// ISG kernel, Volumetric Compensation: error parameters by the names of ISO 230-1, in mm and rad,
// from ISG_CSV or Etalon Exchange Format.
#include <fmt/format.h>

#include <map>

#include "control_tables.hpp"

namespace abbe::daemon {
namespace {

/// Tables by the name of the error, such as EAX.
using ErrorTables = std::map<std::string, std::vector<TablePoint>, std::less<>>;

bool is_component_error(std::string_view name) {
  constexpr std::string_view kMotions = "XYZABC", kAxes = "XYZ";
  return name.size() == 3 && name[0] == 'E' && kMotions.find(name[1]) != kMotions.npos &&
         kAxes.find(name[2]) != kAxes.npos;
}

/// The displacement of the tool by all errors, to first order. The errors of an axis move all axes
/// between it and the tool, and the tool.
AxisPosition displacement_mm(const ErrorTables& tables, const ControlSettings& settings,
                             const AxisPosition& position_mm) {
  AxisPosition arm{}, moved{};
  for (std::size_t k = 0; k < 3; ++k) arm[k] = settings.tool_m[k] * 1000.0;

  for (auto axis = settings.order_w_to_t.rbegin(); axis != settings.order_w_to_t.rend(); ++axis) {
    const auto a = static_cast<std::size_t>(*axis - 'X');
    const auto error = [&](char motion) {
      const auto at = tables.find(std::string{'E', motion, *axis});
      return at == tables.end() ? 0.0 : on_table(at->second, position_mm[a]);
    };
    const double alpha = error('A'), beta = error('B'), gamma = error('C');
    moved[0] += error('X') + beta * arm[2] - gamma * arm[1];
    moved[1] += error('Y') + gamma * arm[0] - alpha * arm[2];
    moved[2] += error('Z') + alpha * arm[1] - beta * arm[0];
    arm[a] += position_mm[a];
  }
  return moved;
}

Result<ControlCorrection> correction_of(const ExportFile& file, ErrorTables tables,
                                        const ControlSettings& settings) {
  for (const auto& [name, points] : tables) {
    if (const auto fault = table_fault(points); !fault.empty())
      return at_line(file.name, 1, fmt::format("{}: {}", name, fault));
  }
  if (tables.empty()) return at_line(file.name, 1, "no error table");

  return [tables = std::move(tables), settings](const AxisPosition& commanded_m,
                                                const std::array<int, 3>&) {
    AxisPosition position_mm{};
    for (std::size_t k = 0; k < 3; ++k) position_mm[k] = commanded_m[k] * 1000.0;
    AxisPosition c_m = displacement_mm(tables, settings, position_mm);
    for (double& c : c_m) c *= settings.positive_moves / 1000.0;
    return c_m;
  };
}

/// True for a valid header of a block: the argument, then the tables that depend on it.
bool valid_header(std::span<const std::string_view> words, const ErrorTables& tables) {
  if (words.size() < 2 || words[0].size() != 1) return false;
  for (const auto name : words.subspan(1)) {
    if (!is_component_error(name) || name[2] != words[0][0] || tables.contains(name)) return false;
  }
  return true;
}

}  // namespace

Result<ControlCorrection> read_isg_csv(const ExportFile& file, const ControlSettings& settings) {
  ErrorTables tables;
  std::vector<std::string_view> header;
  for (const TextLine& line : lines_of(file.text, "//")) {
    const auto words = words_of(line.text);
    if (words.empty()) continue;
    if (words.front() == "#") {
      header.clear();
      continue;
    }
    if (header.empty()) {
      if (!valid_header(words, tables))
        return at_line(file.name, line.number, "not the header of a table of one axis");
      header = words;
      for (const auto name : std::span(header).subspan(1)) tables[std::string(name)];
      continue;
    }

    const auto position = plain_number(words.front());
    if (words.size() != header.size() || !position)
      return at_line(file.name, line.number, "not a row of the table");
    for (std::size_t column = 1; column < words.size(); ++column) {
      const auto value = plain_number(words[column]);
      if (!value) return at_line(file.name, line.number, "a value is not a number");
      tables.find(header[column])->second.push_back({*position, *value});
    }
  }
  return correction_of(file, std::move(tables), settings);
}

Result<ControlCorrection> read_etalon(const ExportFile& file, const ControlSettings& settings) {
  enum class Expected { Name, Begin, Row };
  ErrorTables tables;
  std::vector<TablePoint>* points = nullptr;
  Expected expected = Expected::Name;

  for (const TextLine& line : lines_of(file.text, "//")) {
    const auto words = words_of(line.text);
    if (words.empty()) continue;
    const auto first = words.front();
    if (expected == Expected::Name) {
      const bool name = words.size() == 1 && first.size() == 5 && first.front() == '[' &&
                        first.back() == ']' && is_component_error(first.substr(1, 3));
      if (!name || tables.contains(first.substr(1, 3)))
        return at_line(file.name, line.number, "not the name of a new table");
      points = &tables[std::string(first.substr(1, 3))];
      expected = Expected::Begin;
    } else if (expected == Expected::Begin) {
      if (words.size() != 3 || first != "Gridpoints" || words[1] != "=" || words[2] != "{")
        return at_line(file.name, line.number, "must be: Gridpoints = {");
      expected = Expected::Row;
    } else if (first == "}") {
      expected = Expected::Name;
    } else {
      const auto position = plain_number(first);
      const auto value = words.size() == 2 ? plain_number(words[1]) : std::nullopt;
      if (!position || !value) return at_line(file.name, line.number, "not two numbers");
      points->push_back({*position, *value});
    }
  }
  if (expected != Expected::Name) return at_line(file.name, 1, "the last table has no end");
  return correction_of(file, std::move(tables), settings);
}

}  // namespace abbe::daemon
