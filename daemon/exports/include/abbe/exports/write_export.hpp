#pragma once
/// Writes the text of the files of a control. Errors are in mm (rotations in rad), positions in mm.

#include <variant>

#include "abbe/base/error.hpp"
#include "abbe/calib/export/held_correction.hpp"
#include "abbe/exports/export_format.hpp"

namespace abbe::daemon {

/// Texts about the origin of a file. The file contains them if its format has comments.
struct ExportOrigin {
  std::string model_hash, machine, volume, tool, direction;
  /// the lines of statements_of_use(): verdict, and who forced the export and why
  std::vector<std::string> use{};
};

struct WriteOptions {
  std::array<std::string, 3> axis_names{"X", "Y", "Z"};
  int positive_moves = 1;  ///< same as FormatFacts::positive_moves, or given by the user
  ExportOrigin origin;
};

using HeldCorrection = std::variant<calib::HeldTables, calib::HeldGrid>;

/// Usage if the format limits the number of nodes and an axis has more. `held` must be of the kind
/// that the format holds. Line breaks and characters outside printable ASCII in `origin` become
/// "?". Pure.
[[nodiscard]] Result<std::vector<ExportFile>> write_export(ExportFormat, const HeldCorrection& held,
                                                           const WriteOptions&);

}  // namespace abbe::daemon
