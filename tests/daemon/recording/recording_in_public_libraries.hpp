#pragma once
/// Runs mcap_npm/verify.mjs, which reads recordings with @mcap/core and the OMG IDL libraries of
/// npm.

#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "recording_fixture.hpp"

namespace abbe::daemon {

class PublicLibraries {
 public:
  /// Node and npm are there; without them the test has to be skipped.
  [[nodiscard]] static bool available() {
    return std::system("command -v node >/dev/null 2>&1 && command -v npm >/dev/null 2>&1") == 0;
  }
  static constexpr const char* kSkipped =
      "node and npm are not installed: the public MCAP libraries were not asked";

  /// Installs the libraries beside the test program (once, as in package-lock.json), then
  /// runs the check in them.
  [[nodiscard]] static nlohmann::json verify(const std::string& arguments) {
    const auto folder = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "mcap_npm";
    install(folder);
    const std::string output = run("cd '" + folder.string() + "' && node verify.mjs " + arguments);
    auto json = nlohmann::json::parse(output, nullptr, false);
    EXPECT_FALSE(json.is_discarded())
        << "verify.mjs " << arguments << " printed: " << output.substr(0, 500);
    return json;
  }

 private:
  static void install(const std::filesystem::path& folder) {
    const std::filesystem::path source =
        std::filesystem::path(ABBE_TEST_DATA) / "../daemon/recording/mcap_npm";
    std::filesystem::create_directories(folder);
    std::FILE* lock = std::fopen((folder / "lock").c_str(), "w");
    if (lock == nullptr) throw std::runtime_error("no lock file in " + folder.string());
    ::flock(::fileno(lock), LOCK_EX);  // tests run in parallel
    const bool installed =
        std::filesystem::exists(folder / "node_modules/.package-lock.json") &&
        bytes_of_file(folder / "package-lock.json") == bytes_of_file(source / "package-lock.json");

    for (const char* name : {"package.json", "package-lock.json", "verify.mjs"}) {
      std::filesystem::copy_file(source / name, folder / name,
                                 std::filesystem::copy_options::overwrite_existing);
    }

    if (!installed)
      run("cd '" + folder.string() + "' && npm ci --ignore-scripts --no-audit --no-fund 2>&1");
    std::fclose(lock);
  }

  /// Standard output; a failing command fails the test with it.
  static std::string run(const std::string& command) {
    std::FILE* pipe = ::popen(command.c_str(), "r");
    if (pipe == nullptr) throw std::runtime_error("popen: " + command);
    std::string output;
    std::array<char, 4096> buffer{};
    while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
      output.append(buffer.data(), n);
    EXPECT_EQ(::pclose(pipe), 0) << command << "\n" << output.substr(0, 2000);
    return output;
  }
};

}  // namespace abbe::daemon
