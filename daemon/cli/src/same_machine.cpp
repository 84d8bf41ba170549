#include "same_machine.hpp"

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

namespace abbe::daemon {

void add_other_machine_option(CLI::App& command, bool& other_machine) {
  command.add_flag("--other-machine", other_machine,
                   "compare although the machines are different; the output then names them");
}

}  // namespace abbe::daemon
