#pragma once
/// `abbe`, the built program, as people use it.

#include <fmt/format.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "text_files.hpp"

namespace abbe::daemon::test {

struct Ran {
  int exit = -1;  ///< -1: ended by a signal
  std::string out, err;
};

/// `arguments` as a shell takes them; `folder` is where the program runs, and keeps its output.
[[nodiscard]] inline Ran run_abbe(const std::filesystem::path& folder,
                                  const std::string& arguments) {
  const auto out = folder / "stdout", err = folder / "stderr";
  const auto command = fmt::format("cd '{}' && '{}' {} >'{}' 2>'{}'", folder.string(), ABBE_PROGRAM,
                                   arguments, out.string(), err.string());
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text_of(out), text_of(err)};
}

}  // namespace abbe::daemon::test
