// Writers for formats of tables that add to one axis (LinuxCNC, Siemens, Heidenhain), and for the
// grid.
#include <fmt/format.h>

#include <algorithm>

#include "abbe/base/units.hpp"
#include "writers.hpp"

namespace abbe::daemon {
namespace {

using calib::HeldTable;
using calib::HeldTables;

/// True if no value of the table would differ from 0 in the file.
bool is_zero(const HeldTable& table) {
  constexpr double kLeast_m = 0.5e-12;
  const auto small = [](double value) { return std::abs(value) < kLeast_m; };
  return std::all_of(table.value.begin(), table.value.end(), small) &&
         std::all_of(table.half_forward.begin(), table.half_forward.end(), small);
}

bool has_directions(const HeldTable& table) {
  return std::any_of(table.half_forward.begin(), table.half_forward.end(),
                     [](double value) { return value != 0.0; });
}

double step_m(const std::vector<double>& nodes) {
  return (nodes.back() - nodes.front()) / static_cast<double>(nodes.size() - 1);
}

/// The assignments of table number `t`; `direction` is the value of $AN_CEC_DIRECTION.
std::string cec_table(std::size_t t, const HeldTable& table, const HeldTables& held,
                      const WriteOptions& options, int direction) {
  const auto& nodes = held.nodes_m[calib::index(table.motion.axis)];
  const auto& output = options.axis_names[calib::direction(table.motion.motion)];
  const auto& input = options.axis_names[calib::index(table.motion.axis)];
  std::string text = fmt::format("; {}: MD18342 $MN_MM_CEC_MAX_POINTS[{}] >= {}\n",
                                 calib::name(table.motion), t, nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i)
    text += fmt::format("$AN_CEC[{},{}]={}\n", t, i,
                        file_value(table, i, options.positive_moves, direction));

  text += fmt::format("$AN_CEC_INPUT_AXIS[{}]=({})\n", t, input);
  text += fmt::format("$AN_CEC_OUTPUT_AXIS[{}]=({})\n", t, output);
  text += fmt::format("$AN_CEC_STEP[{}]={}\n", t, fixed_mm(step_m(nodes)));
  text += fmt::format("$AN_CEC_MIN[{}]={}\n", t, fixed_mm(nodes.front()));
  text += fmt::format("$AN_CEC_MAX[{}]={}\n", t, fixed_mm(nodes.back()));
  text += fmt::format("$AN_CEC_DIRECTION[{}]={}\n", t, direction);
  text += fmt::format("$AN_CEC_MULT_BY_TABLE[{}]=0\n", t);
  return text + fmt::format("$AN_CEC_IS_MODULO[{}]=0\n", t);
}

std::string lec_table(const HeldTable& table, const HeldTables& held, const WriteOptions& options) {
  const auto a = calib::index(table.motion.axis);
  const auto& nodes = held.nodes_m[a];
  const auto& axis = options.axis_names[a];
  std::string text =
      fmt::format("; {}: MD38000 $MA_MM_ENC_COMP_MAX_POINTS >= {}\n", axis, nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i)
    text += fmt::format("$AA_ENC_COMP[0,{},{}]={}\n", i, axis,
                        file_value(table, i, options.positive_moves));

  text += fmt::format("$AA_ENC_COMP_STEP[0,{}]={}\n", axis, fixed_mm(step_m(nodes)));
  text += fmt::format("$AA_ENC_COMP_MIN[0,{}]={}\n", axis, fixed_mm(nodes.front()));
  text += fmt::format("$AA_ENC_COMP_MAX[0,{}]={}\n", axis, fixed_mm(nodes.back()));
  return text + fmt::format("$AA_ENC_COMP_IS_MODULO[0,{}]=0\n", axis);
}

/// A .COM table: its columns are the corrected axes, its rows the positions of one axis.
std::string com_table(calib::Axis axis, const HeldTables& held, const WriteOptions& options) {
  std::vector<const HeldTable*> tables;
  std::string text = "NR AXISPOS";
  for (const auto& table : held.tables) {
    if (table.motion.axis != axis) continue;
    tables.push_back(&table);
    text += " " + options.axis_names[calib::direction(table.motion.motion)];
  }
  text += "\n";

  const auto& nodes = held.nodes_m[calib::index(axis)];
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    text += fmt::format("{} {}", i, fixed_mm(nodes[i]));
    for (const auto* table : tables) text += " " + file_value(*table, i, options.positive_moves);
    text += "\n";
  }
  return text + "[END]\n";
}

}  // namespace

ExportFiles write_linuxcnc(const HeldTables& held) {
  ExportFiles files;
  for (const auto& table : held.tables) {
    const auto& nodes = held.nodes_m[calib::index(table.motion.axis)];
    std::string text;
    for (std::size_t i = 0; i < nodes.size(); ++i)
      text += fmt::format("{} {} {}\n", fixed_mm(nodes[i]), file_value(table, i, 1, 1),
                          file_value(table, i, 1, -1));
    const char small = static_cast<char>(calib::letter(table.motion.axis) - 'A' + 'a');
    files.push_back({fmt::format("{}.comp", small), text});
  }
  return files;
}

ExportFiles write_siemens_cec(const HeldTables& held, const WriteOptions& options) {
  std::string text = "%_N_NC_CEC_INI\n";
  text += origin_comment(options.origin, ";", sign_text(options.positive_moves));
  text += "CHANDATA(1)\n";

  std::size_t t = 0;
  for (const auto& table : held.tables) {
    if (is_zero(table)) continue;
    if (!has_directions(table)) {
      text += cec_table(t++, table, held, options, 0);
      continue;
    }
    for (const int direction : {1, -1}) text += cec_table(t++, table, held, options, direction);
  }
  return {{"", text + "M17\n"}};
}

ExportFiles write_siemens_lec(const HeldTables& held, const WriteOptions& options) {
  std::string text = "%_N_AX_EEC_INI\n";
  text += origin_comment(options.origin, ";", sign_text(options.positive_moves));
  text += "CHANDATA(1)\n";
  for (const auto& table : held.tables) text += lec_table(table, held, options);
  return {{"", text + "M17\n"}};
}

ExportFiles write_heidenhain(const HeldTables& held, const WriteOptions& options) {
  ExportFiles files;
  std::string columns, row;
  for (const calib::Axis axis : calib::kAllAxes) {
    const auto& name = options.axis_names[calib::index(axis)];
    files.push_back({name + ".COM", com_table(axis, held, options)});
    columns += " " + name;
    row += " " + files.back().name;
  }
  files.push_back({"config.cma", fmt::format("NR ACTIVE{}\n0 *{}\n[END]\n", columns, row)});
  return files;
}

ExportFiles write_csv_grid(const calib::HeldGrid& grid, const WriteOptions& options) {
  std::string text = "# quantity = command_correction\n";
  text += origin_comment(options.origin, "#", "sign: add c to the commanded position");
  text += "x_mm,y_mm,z_mm,cx_um,cy_um,cz_um,inside\n";

  std::size_t n = 0;
  for (const double x : grid.axes_m[0]) {
    for (const double y : grid.axes_m[1]) {
      for (const double z : grid.axes_m[2]) {
        const calib::Vector3 c_um = kUmPerM * grid.c_node_m[n];
        text += fmt::format("{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{}\n", x * kMmPerM,
                            y * kMmPerM, z * kMmPerM, c_um[0], c_um[1], c_um[2],
                            grid.inside[n] ? 1 : 0);
        ++n;
      }
    }
  }
  return {{"", text}};
}

}  // namespace abbe::daemon
