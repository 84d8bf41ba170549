#pragma once
/// The path of an on-the-fly calibration as a program for the machine's control: straight moves at
/// one feed in machine coordinates, an exact stop and a dwell at each vertex. Positions are in mm.
/// Pure.
///
/// The program moves to the first vertex and stops (M0, STOP). The operator starts
/// `abbe calibrate otf` and continues the program when it waits for the machine to leave. At the
/// end it stands still for as long as the session needs to recognise the end of the run.

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/calib/otf/plan/plan_prediction.hpp"

namespace abbe::daemon {

enum class Dialect { LinuxCnc, Siemens, Heidenhain };
inline constexpr std::array kDialects{Dialect::LinuxCnc, Dialect::Siemens, Dialect::Heidenhain};
[[nodiscard]] std::string_view name(Dialect dialect) noexcept;  ///< "linuxcnc"
/// extension of its files: ".ngc"
[[nodiscard]] std::string_view extension(Dialect dialect) noexcept;
/// The dialect with this name; nullopt for an unknown name.
[[nodiscard]] std::optional<Dialect> dialect_named(std::string_view name) noexcept;

/// `stand_s`: standstill before the first leg and after the last. A program for machine coordinates
/// ignores work offsets: G53 in each block (LinuxCNC), SUPA (Siemens), M91 (Heidenhain). Tool
/// length compensation is cancelled by G49 and D0; on a Heidenhain control no tool may be active.
[[nodiscard]] std::string path_program(const calib::otf::Path& path, const calib::otf::Drive& drive,
                                       double stand_s, Dialect dialect);

}  // namespace abbe::daemon
