#include "files.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace abbe::sim {

Result<std::string> read_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in || std::filesystem::is_directory(path)) {
    return io_error(path + ": cannot be read: " + (in ? "is a directory" : std::strerror(errno)));
  }
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

std::string beside_file(const std::string& file, const std::string& path) {
  return (std::filesystem::path(file).parent_path() / path).string();
}

Result<void> write_file(const std::string& path, std::string_view text) {
  if (path == "-") {
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() ||
        std::fflush(stdout) != 0) {
      return io_error(std::string("standard output: ") + std::strerror(errno));
    }
    return {};
  }

  const std::string beside = path + ".part";
  {
    std::ofstream out(beside, std::ios::binary | std::ios::trunc);
    out << text << std::flush;
    if (!out) return io_error(path + ": cannot be written: " + std::strerror(errno));
  }

  if (std::rename(beside.c_str(), path.c_str()) != 0) {
    return io_error(path + ": cannot be written: " + std::strerror(errno));
  }

  return {};
}

}  // namespace abbe::sim
