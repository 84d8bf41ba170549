#pragma once
/// Options of `abbe export`, checked.

#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/export/held_correction.hpp"
#include "abbe/exports/export_format.hpp"
#include "abbe/tasks/forced_use.hpp"
#include "abbe/tasks/model_source.hpp"

namespace abbe::daemon {

struct ExportArguments {
  std::string model, to, out, tool, volume, axis_map, positive, direction;
  StoreOption store;
  ForceOption force;
  std::optional<double> step_mm;
};

/// The format of --to; Usage with all names if there is none.
[[nodiscard]] Result<const FormatFacts*> format_of(const std::string& to);

/// --volume-mm "xmin,xmax,ymin,ymax,zmin,zmax" in mm; nullopt if empty.
[[nodiscard]] Result<std::optional<calib::ExportBox>> volume_of(const std::string& text);

/// --axis-map "X=AX1,Y=AX2,Z=AX3": the control's names of X, Y and Z. Axes that are not given keep
/// the names of the format. Usage for a format without names, and for names that a control cannot
/// have or that occur twice.
[[nodiscard]] Result<std::array<std::string, 3>> axis_names_of(const std::string& text,
                                                               const FormatFacts&);

/// --positive "plus" or "minus": +1 or -1. Usage if the format needs it and it is not given, or if
/// it is given and the format has a fixed sign.
[[nodiscard]] Result<int> positive_moves_of(const std::string& text, const FormatFacts&);

}  // namespace abbe::daemon
