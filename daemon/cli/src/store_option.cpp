#include "store_option.hpp"

#include <fmt/format.h>

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <cstdio>

#include "abbe/base/printable.hpp"

namespace abbe::daemon {

void add_store_options(CLI::App& command, StoreOption& where) {
  auto* store =
      command.add_option("--store", where.folder, "folder of the store")->capture_default_str();
  command.add_option("-c,--config", where.config, "use the store of this abbed.toml")
      ->excludes(store);
}

void print_cautions(const std::string& name, const FoundModel& model) {
  for (const std::string& caution : cautions_of(model))
    fmt::print(stderr, "abbe: caution: {}: {}\n", printable_line(name), printable_line(caution));
}

}  // namespace abbe::daemon
