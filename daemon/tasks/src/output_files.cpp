#include "abbe/tasks/output_files.hpp"

#include <fmt/format.h>

#include <system_error>

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

/// True if both paths mean the same file, also through links, and also if the files do not exist
/// yet.
bool are_the_same(const fs::path& a, const fs::path& b) {
  std::error_code fault;
  if (fs::equivalent(a, b, fault)) return true;
  // empty: the path cannot be determined
  const auto whole = fs::weakly_canonical(fs::absolute(a), fault);
  return !whole.empty() && whole == fs::weakly_canonical(fs::absolute(b), fault);
}

}  // namespace

Result<void> require_own_files(std::span<const fs::path> read, std::span<const fs::path> written) {
  for (std::size_t i = 0; i < written.size(); ++i) {
    if (written[i].empty()) continue;
    for (const fs::path& input : read)
      if (!input.empty() && are_the_same(input, written[i]))
        return fail(ErrorCode::Usage,
                    fmt::format("write {}: this command reads this file; choose another name",
                                written[i].string()));
    for (const fs::path& other : written.first(i))
      if (!other.empty() && are_the_same(other, written[i]))
        return fail(ErrorCode::Usage,
                    fmt::format("write {}: this file is named for two outputs; choose another name",
                                written[i].string()));
  }
  return {};
}

Result<void> require_place_of(const fs::path& file) {
  std::error_code ignored;
  const auto folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, ignored))
    return fail(ErrorCode::Io,
                fmt::format("write {}: there is no folder {}", file.string(), folder.string()));
  const auto kind = fs::status(file, ignored).type();
  if (kind == fs::file_type::not_found || kind == fs::file_type::regular) return {};
  return fail(ErrorCode::Io, fmt::format("write {}: it exists and is not a file", file.string()));
}

}  // namespace abbe::daemon
