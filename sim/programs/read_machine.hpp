#pragma once
/// The tables that the daemon reads too. Keys that only the daemon uses are ignored.

#include "setup_draft.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

void read_machine_tables(Section root, SetupDraft& draft);

}  // namespace abbe::sim
