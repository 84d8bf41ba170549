#include "force_option.hpp"

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

namespace abbe::daemon {

CLI::Option* add_force_options(CLI::App& command, ForceOption& options, const std::string& what,
                               const std::string& why) {
  command.add_option("--why,--reason", options.why, why);
  return command.add_flag("--force", options.force, what);
}

}  // namespace abbe::daemon
