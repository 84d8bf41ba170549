#pragma once
/// A file of numbers read, hashed and parsed; what its meaning forbids is added to `faults` by who
/// reads it.

#include <filesystem>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/base/number_table.hpp"

namespace abbe::daemon {

struct ParsedTable {
  InputFile source;
  NumberTable table;
  Faults faults;
};

/// BadInput with all faults of the text.
[[nodiscard]] Result<ParsedTable> parse_table(const std::filesystem::path& file,
                                              const std::vector<TableForm>& forms,
                                              const ReadProgress& progress = {});

/// A fault where there are fewer than `least` rows ("vertices").
void check_rows(ParsedTable& parsed, std::size_t least, std::string_view what);

}  // namespace abbe::daemon
