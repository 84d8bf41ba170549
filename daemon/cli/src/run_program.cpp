#include "run_program.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

namespace abbe::daemon {
namespace {

std::filesystem::path own_folder() {
  std::error_code ignored;
  return std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
}

}  // namespace

Error exec_program(std::vector<std::string> words) {
  const auto program = words[0] = fmt::format("abbe-{}", words[0]);
  const auto beside = (own_folder() / program).string();
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  ::execv(beside.c_str(), arguments.data());
  ::execvp(program.c_str(), arguments.data());
  return {ErrorCode::Io, fmt::format("run {}: neither in the folder of abbe nor in PATH: {}",
                                     program, std::strerror(errno))};
}

}  // namespace abbe::daemon
