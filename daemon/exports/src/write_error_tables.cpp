// Formats of error tables with the names of ISO 230-1: ISG_CSV and Etalon Exchange Format.
#include <fmt/format.h>

#include "writers.hpp"

namespace abbe::daemon {
namespace {

std::vector<const calib::HeldTable*> tables_of_axis(const calib::HeldTables& held,
                                                    calib::Axis axis) {
  std::vector<const calib::HeldTable*> tables;
  for (const auto& table : held.tables) {
    if (table.motion.axis == axis) tables.push_back(&table);
  }
  return tables;
}

}  // namespace

ExportFiles write_isg_csv(const calib::HeldTables& held, const WriteOptions& options) {
  std::string text = origin_comment(options.origin, "//", sign_text(options.positive_moves));
  text += "// units: mm and rad; squareness is contained in the slopes of EXY, EXZ and EYZ\n";

  for (const calib::Axis axis : calib::kAllAxes) {
    if (axis != calib::Axis::X) text += "#\n";
    const auto tables = tables_of_axis(held, axis);
    text += calib::letter(axis);
    for (const auto* table : tables) text += " " + calib::name(table->motion);
    text += "\n";

    const auto& nodes = held.nodes_m[calib::index(axis)];
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      text += fixed_mm(nodes[i]);
      for (const auto* table : tables) text += " " + file_value(*table, i, options.positive_moves);
      text += "\n";
    }
  }
  return {{"", text}};
}

ExportFiles write_etalon(const calib::HeldTables& held, const WriteOptions& options) {
  std::string text;
  for (const auto& table : held.tables) {
    const auto name = calib::name(table.motion);
    const auto& nodes = held.nodes_m[calib::index(table.motion.axis)];
    text += fmt::format("[{}]\nGridpoints = {{\n", name);
    for (std::size_t i = 0; i < nodes.size(); ++i)
      text += fixed_mm(nodes[i]) + " " + file_value(table, i, options.positive_moves) + "\n";
    // Comments are recognised only after the end of a table, so each table repeats the whole
    // origin.
    text += fmt::format("}} // end of {}; {}\n", name,
                        origin_in_one_line(options.origin, sign_text(options.positive_moves)));
  }
  return {{"", text}};
}

}  // namespace abbe::daemon
