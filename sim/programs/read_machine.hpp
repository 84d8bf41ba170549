#pragma once
/// Reads the tables that the daemon also reads. Keys that only the daemon uses are ignored.

#include <string>

#include "setup_draft.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

/// True if [axes] has a rotary axis of this name.
[[nodiscard]] bool is_rotary(Section root, const std::string& name);
void read_machine_tables(Section root, SetupDraft& draft);

}  // namespace abbe::sim
