#include "toml_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "abbe/result/try.hpp"
#include "abbe/sections/bounded_toml.hpp"
#include "files.hpp"

namespace abbe::sim {

Result<void> read_toml_file(const std::string& file, const std::function<void(Section)>& reader) {
  const auto text = read_file(file);
  ABBE_TRY(text);
  const auto table = sections::parse_bounded(*text, file);
  if (!table) {
    const auto& [why, lines] = table.error();
    return bad_input(lines.empty() ? why : fmt::format("{}", fmt::join(lines, "\n")));
  }

  protocol::Faults faults(file);
  reader(Section(&*table, "", {1, 1}, faults));
  if (faults.any()) return bad_input(fmt::format("{}", fmt::join(faults.lines(), "\n")));
  return {};
}

}  // namespace abbe::sim
