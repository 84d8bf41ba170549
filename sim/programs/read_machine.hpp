#pragma once
/// The tables the daemon reads too. Keys that only it knows are none of ours.

#include "setup_draft.hpp"
#include "toml_section.hpp"

namespace abbe::sim {

void read_machine_tables(TomlSection root, SetupDraft& draft);

}  // namespace abbe::sim
