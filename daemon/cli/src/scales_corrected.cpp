#include "scales_corrected.hpp"

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

namespace abbe::daemon {

CLI::Option* add_scales_corrected(CLI::App& command, bool& corrected) {
  return command.add_flag(
      "--scales-corrected,--path-corrected", corrected,
      "the readings of the files are corrected for the temperature of the scales\n"
      "([[thermal]])");
}

}  // namespace abbe::daemon
