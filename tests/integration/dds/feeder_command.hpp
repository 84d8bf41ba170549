#pragma once
/// The command that starts abbed's stand-in (feeder.cpp) with its abbe-dds.

#include <filesystem>
#include <string>
#include <vector>

namespace abbe::test {

/// `folder`: of the socket; `more`: further arguments of abbe-dds.
[[nodiscard]] inline std::vector<std::string> feeder_command(const std::filesystem::path& folder,
                                                             const std::string& machine,
                                                             const std::string& domain,
                                                             const std::string& profile,
                                                             const std::vector<std::string>& more) {
  const std::string socket = folder / (machine + ".sock");
  std::vector<std::string> command{ABBE_FEEDER_PROGRAM, socket, machine,    ABBE_DDS_PROGRAM,
                                   "--socket",          socket, "--domain", domain,
                                   "--profile",         profile};
  command.insert(command.end(), more.begin(), more.end());
  return command;
}

}  // namespace abbe::test
