/// The options that select the machine; several commands have them.

#include <CLI/CLI.hpp>

#include "setup_file.hpp"

namespace abbe::sim {

void add_machine_options(CLI::App& app, SetupChoices& choices) {
  app.add_option("--config", choices.config_file, "TOML file with a [sim] table")
      ->type_name("FILE");
  app.add_option("--machine", choices.machine_file,
                 "machine description: machine.toml or abbed.toml")
      ->type_name("FILE");
  app.add_option("--seed", choices.seed, "seed of the errors and of all noise (default 1)");
  app.add_option("--truth", choices.truth_file, "CSV file of the errors, instead of random errors")
      ->type_name("FILE");
}

}  // namespace abbe::sim
