#include "abbe/base/parsed_table.hpp"

#include <fmt/format.h>

#include "abbe/base/sha256.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

Result<ParsedTable> parse_table(const std::filesystem::path& file,
                                const std::vector<TableForm>& forms, const ReadProgress& progress) {
  const auto text = read_text(file);
  ABBE_TRY(text);
  return parse_table(*text, file, forms, progress);
}

Result<ParsedTable> parse_table(std::string_view text, const std::filesystem::path& file,
                                const std::vector<TableForm>& forms, const ReadProgress& progress) {
  Faults faults(file.string());
  auto table = parse_numbers(text, forms, faults, progress);
  if (!table) return tl::make_unexpected(faults.to_error());
  return ParsedTable{
      {file.filename().string(), sha256_hex(text)}, std::move(*table), std::move(faults)};
}

void check_rows(ParsedTable& parsed, std::size_t least, std::string_view what) {
  const auto& table = parsed.table;
  if (table.rows() >= least) return;
  const auto line = table.rows() == 0 ? 1 : table.line(table.rows() - 1);
  parsed.faults.add(line, 1, "",
                    fmt::format("needs at least {} {}, has {}", least, what, table.rows()));
}

}  // namespace abbe::daemon
