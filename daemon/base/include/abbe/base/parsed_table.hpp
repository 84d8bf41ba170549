#pragma once
/// Reads, hashes and parses a file of numbers. The caller then checks the values and adds a fault
/// to `faults` for each invalid value.

#include <filesystem>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/faults.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/protocol/table/number_table.hpp"

namespace abbe::daemon {

using protocol::NumberTable;
using protocol::TableForm;

struct ParsedTable {
  InputFile source;
  NumberTable table;
  Faults faults;
};

/// Reads and parses the file; its header must match one of `forms`. Io if the file cannot be read;
/// BadInput with all faults if the header is invalid.
[[nodiscard]] Result<ParsedTable> parse_table(const std::filesystem::path& file,
                                              const std::vector<TableForm>& forms,
                                              const ReadProgress& progress = {});
/// Same as the function above, for the content of a file that another process has read.
[[nodiscard]] Result<ParsedTable> parse_table(std::string_view text,
                                              const std::filesystem::path& file,
                                              const std::vector<TableForm>& forms,
                                              const ReadProgress& progress = {});

/// Adds a fault if there are fewer than `least` rows. `what` is the name of the rows in the
/// message: "vertices".
void check_rows(ParsedTable& parsed, std::size_t least, std::string_view what);

}  // namespace abbe::daemon
