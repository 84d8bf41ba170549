#pragma once
/// The file formats of controls. daemon/docs/exports.md describes what each control does with its
/// files.

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

/// The part of a correction that a file of the format can contain.
enum class HeldPart {
  Errors,        ///< the error tables of a machine, rotations with levers
  Positioning,   ///< a table for each axis, a function of its own position
  Translations,  ///< a table for each pair of axes
  Grid           ///< vectors at the nodes of a grid
};

struct FormatFacts {
  ExportFormat format;
  std::string_view name;     ///< name of the format in the option --to
  std::string_view control;  ///< name of the control, in messages
  HeldPart holds;
  bool per_direction = false;  ///< the file has separate values for both directions of travel
  bool equidistant = false;
  std::size_t most_nodes = 0;  ///< largest number of nodes of an axis; 0: no limit is known
  bool folder = false;         ///< the export has several files
  bool comments = true;        ///< the file has comments that contain ExportOrigin
  std::array<std::string_view, 3> axis_names{"X", "Y", "Z"};
  bool axes_named = false;  ///< the file contains names of axes that the control defines
  /// +1 or -1: direction in which a positive value moves the axis; 0: not found in public
  /// documents, the user gives it
  int positive_moves = 0;
  bool positive_fixed = false;   ///< the user cannot change positive_moves
  std::string_view source = {};  ///< document from which the sign was taken
};

[[nodiscard]] const FormatFacts& facts_of(ExportFormat);
[[nodiscard]] const FormatFacts* format_named(std::string_view name);
/// The names of all formats as text: "isg-csv, etalon, ...".
[[nodiscard]] std::string format_names();

/// A file of an export. `name` is empty if the format has one file, whose name the user gives.
struct ExportFile {
  std::string name, text;
};

}  // namespace abbe::daemon
