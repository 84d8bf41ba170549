#pragma once
/// Reads [sim] and all tables below it.

#include <string>

#include "setup_draft.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

/// `file` is the file that contains `sim`: paths are relative to its folder.
void read_sim(Section sim, const std::string& file, SetupDraft& draft);

}  // namespace abbe::sim
