#pragma once
/// Reads the tables that the daemon also reads. Keys that only the daemon uses are ignored.

#include "setup_draft.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

void read_machine_tables(Section root, SetupDraft& draft);

}  // namespace abbe::sim
