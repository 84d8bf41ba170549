#pragma once

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace abbe::daemon::test {

/// Empty for a file that is not there.
[[nodiscard]] inline std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

inline void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

}  // namespace abbe::daemon::test
