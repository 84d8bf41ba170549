#pragma once
/// The file formats of controls. What each control does with its files: daemon/docs/exports.md.

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace abbe::daemon {

enum class ExportFormat {
  IsgCsv,
  Etalon,
  LinuxcncComp,
  SiemensCec,
  SiemensLec,
  HeidenhainCom,
  CsvGrid
};

/// Which part of a correction a format holds.
enum class HeldPart {
  Errors,        ///< the error tables of a machine, rotations with levers
  Positioning,   ///< a table for each axis, a function of its own position
  Translations,  ///< a table for each pair of axes
  Grid           ///< vectors at the nodes of a grid
};

struct FormatFacts {
  ExportFormat format;
  std::string_view name;     ///< as in --to
  std::string_view control;  ///< for people
  HeldPart holds;
  bool per_direction = false;  ///< separate values for both directions of travel
  bool equidistant = false;
  std::size_t most_nodes = 0;  ///< of an axis; 0: no limit is known
  bool folder = false;         ///< several files
  bool comments = true;        ///< ExportOrigin is in the file
  std::array<std::string_view, 3> axis_names{"X", "Y", "Z"};
  bool axes_named = false;  ///< the file contains names of axes that the control defines
  /// +1 or -1: direction in which a positive value moves the axis; 0: not found in public
  /// documents, the user gives it
  int positive_moves = 0;
  bool positive_fixed = false;   ///< the user cannot change it
  std::string_view source = {};  ///< of the sign
};

[[nodiscard]] const FormatFacts& facts_of(ExportFormat);
[[nodiscard]] const FormatFacts* format_named(std::string_view name);
/// "isg-csv, etalon, ..."
[[nodiscard]] std::string format_names();

/// A file of an export. `name` is empty if the format has one file, whose name the user gives.
struct ExportFile {
  std::string name, text;
};

}  // namespace abbe::daemon
