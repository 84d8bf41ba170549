#pragma once
/// Reads and checks the options of `abbe export`.

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

/// The format named by the option --to. Usage if there is no such format; the text lists all
/// formats.
[[nodiscard]] Result<const FormatFacts*> format_of(const std::string& to);

/// The volume of the option --volume-mm "xmin,xmax,ymin,ymax,zmin,zmax"; nullopt if the text is
/// empty.
[[nodiscard]] Result<std::optional<calib::ExportBox>> volume_of(const std::string& text);

/// The control's names of X, Y and Z, from the option --axis-map "X=AX1,Y=AX2,Z=AX3". Axes that are
/// not given keep the names of the format. Usage for a format without names, and for names that a
/// control cannot have or that occur twice.
[[nodiscard]] Result<std::array<std::string, 3>> axis_names_of(const std::string& text,
                                                               const FormatFacts&);

/// The sign of the option --positive: +1 for "plus", -1 for "minus". Usage if the format needs the
/// option and it is not given, or if it is given although the format has a fixed sign.
[[nodiscard]] Result<int> positive_moves_of(const std::string& text, const FormatFacts&);

}  // namespace abbe::daemon
