#include "file_of_program.hpp"

#include <fmt/format.h>

#include <fstream>
#include <sstream>

namespace abbe::daemon {

std::string head_of(const std::filesystem::path& file) {
  constexpr std::size_t kHead = 65536;
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return {};
  std::string head(kHead, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(stream.gcount()));
  return head;
}

bool is_own_csv(std::string_view head) {
  std::istringstream lines{std::string(head)};
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line.front() == '#') continue;
    return line.find("_mm") != std::string::npos;
  }
  return false;
}

Error needs_options(const std::string& file, std::string_view what,
                    std::vector<std::string> missing) {
  return {ErrorCode::BadInput, fmt::format("{}: {} needs:", file, what), std::move(missing)};
}

Error options_without_use(const std::string& file, std::string_view options) {
  return {ErrorCode::BadInput,
          fmt::format("{}: a file with columns of abbe states its units and frame: leave out {}",
                      file, options),
          {}};
}

}  // namespace abbe::daemon
