// SINUMERIK 840D sl Function Manual Extended Functions, K3: tables of $AN_CEC and $AA_ENC_COMP.
#include <fmt/format.h>

#include <cmath>
#include <map>

#include "abbe/result/try.hpp"
#include "control_tables.hpp"

namespace abbe::daemon {
namespace {

/// One assignment: "$AN_CEC_STEP[0]=6.73" has a variable, indices and a value.
struct Assignment {
  std::size_t line = 0;
  std::string_view variable, value;
  std::vector<std::string_view> indices;
};

/// The values of one table as assigned in the file.
struct CompensationTable {
  std::map<std::size_t, double> points;
  std::optional<double> step, min, max;
  std::optional<std::size_t> input, output;
  int direction = 0;
};

/// A table as the control uses it.
struct ActiveTable {
  std::size_t input = 0, output = 0;
  int direction = 0;
  std::vector<TablePoint> points;
};

std::optional<Assignment> assignment(const TextLine& line) {
  const auto words = words_of(line.text);
  if (words.size() != 1 || !words.front().starts_with('$')) return std::nullopt;
  const auto word = words.front();
  const auto open = word.find('['), close = word.find("]=");
  if (open == std::string_view::npos || close == std::string_view::npos || close < open)
    return std::nullopt;

  Assignment out{line.number, word.substr(1, open - 1), word.substr(close + 2), {}};
  for (auto rest = word.substr(open + 1, close - open - 1);;) {
    const auto comma = rest.find(',');
    out.indices.push_back(rest.substr(0, comma));
    if (comma == std::string_view::npos) return out;
    rest.remove_prefix(comma + 1);
  }
}

/// The text as a whole number from 0 to 99999; nullopt otherwise.
std::optional<std::size_t> table_index(std::string_view text) {
  const auto number = plain_number(text);
  if (!number || *number < 0.0 || *number > 99999.0 || *number != std::floor(*number))
    return std::nullopt;
  return static_cast<std::size_t>(*number);
}

/// The assignments of a file, whose frame is checked: first line, CHANDATA(1), assignments, M17.
Result<std::vector<Assignment>> assignments_of(const ExportFile& file, std::string_view header) {
  std::vector<Assignment> all;
  bool begun = false, ended = false;
  for (const TextLine& line : lines_of(file.text, ";")) {
    const auto words = words_of(line.text);
    if (line.number == 1 && (words.size() != 1 || words.front() != header))
      return at_line(file.name, 1, fmt::format("must be {}", header));
    if (line.number == 1 || words.empty()) continue;

    if (ended) return at_line(file.name, line.number, "text after M17");
    if (words.size() == 1 && words.front() == "CHANDATA(1)") {
      begun = true;
    } else if (words.size() == 1 && words.front() == "M17") {
      ended = true;
    } else {
      const auto found = assignment(line);
      if (!found || !begun) return at_line(file.name, line.number, "not an assignment");
      all.push_back(*found);
    }
  }
  if (!ended) return at_line(file.name, 1, "the file does not end with M17");
  return all;
}

bool set_number(std::optional<double>& to, std::string_view text) {
  const bool first = !to.has_value();
  to = plain_number(text);
  return first && to.has_value();
}

/// Sets a value of the table. `rest`: name of the variable after AN_CEC or AA_ENC_COMP.
bool set_field(CompensationTable& table, std::string_view rest, const Assignment& a) {
  if (rest == "_STEP") return set_number(table.step, a.value);
  if (rest == "_MIN") return set_number(table.min, a.value);
  if (rest == "_MAX") return set_number(table.max, a.value);
  if (rest == "_IS_MODULO" || rest == "_MULT_BY_TABLE") return a.value == "0";
  return false;
}

bool set_point(CompensationTable& table, std::string_view index, std::string_view value) {
  const auto i = table_index(index);
  const auto number = plain_number(value);
  return i && number && table.points.emplace(*i, *number).second;
}

bool set_axis(std::optional<std::size_t>& to, std::string_view value,
              const ControlSettings& settings) {
  if (to || value.size() < 2 || value.front() != '(' || value.back() != ')') return false;
  to = axis_named(settings, value.substr(1, value.size() - 2));
  return to.has_value();
}

bool set_cec(std::map<std::size_t, CompensationTable>& tables, const Assignment& a,
             const ControlSettings& settings) {
  constexpr std::string_view kName = "AN_CEC";
  const auto t = table_index(a.indices.front());
  if (!t || !a.variable.starts_with(kName)) return false;
  CompensationTable& table = tables[*t];
  const auto rest = a.variable.substr(kName.size());
  if (rest.empty()) return a.indices.size() == 2 && set_point(table, a.indices[1], a.value);
  if (a.indices.size() != 1) return false;

  if (rest == "_INPUT_AXIS") return set_axis(table.input, a.value, settings);
  if (rest == "_OUTPUT_AXIS") return set_axis(table.output, a.value, settings);
  if (rest == "_DIRECTION") {
    table.direction = a.value == "1" ? 1 : a.value == "-1" ? -1 : 0;
    return table.direction != 0 || a.value == "0";
  }
  return set_field(table, rest, a);
}

bool set_lec(std::map<std::size_t, CompensationTable>& tables, const Assignment& a,
             const ControlSettings& settings) {
  constexpr std::string_view kName = "AA_ENC_COMP";
  const auto axis = axis_named(settings, a.indices.back());
  if (!axis || !a.variable.starts_with(kName) || a.indices.front() != "0") return false;
  CompensationTable& table = tables[*axis];
  table.input = table.output = *axis;
  const auto rest = a.variable.substr(kName.size());
  if (rest.empty()) return a.indices.size() == 3 && set_point(table, a.indices[1], a.value);
  return a.indices.size() == 2 && set_field(table, rest, a);
}

/// Makes the active table. Its points are at MIN + i STEP; MAX must be the last of them.
Result<ActiveTable> activated(const ExportFile& file, std::size_t t,
                              const CompensationTable& table) {
  const auto fault = [&](const std::string& what) {
    return at_line(file.name, 1, fmt::format("table {}: {}", t, what));
  };
  if (!table.input || !table.output || !table.step || !table.min || !table.max)
    return fault("axis, step, minimum or maximum is missing");
  if (!(*table.step > 0.0)) return fault("the step is not positive");
  const double last = (*table.max - *table.min) / *table.step;
  if (table.points.size() < 2 ||
      std::abs(last - static_cast<double>(table.points.size() - 1)) > 1e-3)
    return fault(fmt::format("{} points, but (MAX - MIN) / STEP is {}", table.points.size(), last));

  ActiveTable active{*table.input, *table.output, table.direction, {}};
  for (std::size_t i = 0; i < table.points.size(); ++i) {
    const auto at = table.points.find(i);
    if (at == table.points.end()) return fault(fmt::format("point {} is missing", i));
    active.points.push_back({*table.min + static_cast<double>(i) * *table.step, at->second});
  }
  return active;
}

double weight_of(int table_direction, int direction) {
  if (table_direction == 0) return 1.0;
  if (direction == 0) return 0.5;
  return table_direction == direction ? 1.0 : 0.0;
}

template <class Set>
Result<ControlCorrection> read_tables(const ExportFile& file, const ControlSettings& settings,
                                      std::string_view header, Set set) {
  const auto assignments = assignments_of(file, header);
  ABBE_TRY(assignments);
  std::map<std::size_t, CompensationTable> tables;
  for (const Assignment& a : *assignments) {
    if (!set(tables, a, settings))
      return at_line(file.name, a.line,
                     fmt::format("${} is unknown, repeated or has a wrong value", a.variable));
  }

  std::vector<ActiveTable> active;
  for (const auto& [t, table] : tables) {
    auto found = activated(file, t, table);
    ABBE_TRY(found);
    active.push_back(*std::move(found));
  }

  const double mm_per_value = settings.positive_moves;
  return
      [active, mm_per_value](const AxisPosition& commanded_m, const std::array<int, 3>& direction) {
        AxisPosition c_m{};
        for (const ActiveTable& table : active) {
          const double value = on_table(table.points, commanded_m[table.input] * 1000.0);
          c_m[table.output] +=
              mm_per_value * value / 1000.0 * weight_of(table.direction, direction[table.input]);
        }
        return c_m;
      };
}

}  // namespace

Result<ControlCorrection> read_sinumerik_cec(const ExportFile& file,
                                             const ControlSettings& settings) {
  return read_tables(file, settings, "%_N_NC_CEC_INI", set_cec);
}

Result<ControlCorrection> read_sinumerik_lec(const ExportFile& file,
                                             const ControlSettings& settings) {
  return read_tables(file, settings, "%_N_AX_EEC_INI", set_lec);
}

}  // namespace abbe::daemon
