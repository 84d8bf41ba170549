#include "abbe/tasks/pdf_converter.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/output_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

/// A temporary folder that exists as long as the object.
class WorkFolder {
 public:
  WorkFolder() {
    std::error_code ignored;
    std::string pattern = (fs::temp_directory_path(ignored) / "abbe-report-XXXXXX").string();
    if (::mkdtemp(pattern.data()) != nullptr) path_ = pattern;
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  ~WorkFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// The path of the program in the folders of PATH; nullopt if there is none.
std::optional<std::string> program_named(std::string_view name) {
  const char* const path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/usr/bin:/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const std::string file = fmt::format("{}/{}", folder.empty() ? "." : folder, name);
    if (::access(file.c_str(), X_OK) == 0) return file;
  }
  return std::nullopt;
}

/// The command line of the first converter that is installed; empty if there is none.
std::vector<std::string> converter(const fs::path& html, const fs::path& pdf,
                                   const fs::path& profile) {
  if (const auto weasyprint = program_named("weasyprint"))
    return {*weasyprint, html.string(), pdf.string()};
  for (const char* const name : {"chromium", "chromium-browser", "google-chrome"}) {
    const auto chromium = program_named(name);
    if (!chromium) continue;
    std::vector<std::string> words{*chromium,
                                   "--headless",
                                   "--disable-gpu",
                                   "--no-pdf-header-footer",
                                   "--user-data-dir=" + profile.string(),
                                   "--print-to-pdf=" + pdf.string(),
                                   "file://" + html.string()};
    // For root, Chromium cannot use its sandbox. This is safe, because abbe made the page and it
    // contains no script.
    if (::geteuid() == 0) words.insert(words.begin() + 1, "--no-sandbox");
    return words;
  }
  return {};
}

Result<void> no_converter() {
  return fail(ErrorCode::Io,
              "--pdf: no converter is installed; install weasyprint or chromium, or print the HTML "
              "report from a browser");
}

/// Starts the program; its output is discarded. nullopt if it cannot be started.
std::optional<pid_t> start_converter(const std::vector<std::string>& words) {
  std::vector<std::string> copy = words;
  std::vector<char*> arguments;
  for (std::string& word : copy) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  posix_spawn_file_actions_t actions{};
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  // The program gets its own process group, so that its children can be ended together with it.
  posix_spawnattr_t attributes{};
  ::posix_spawnattr_init(&attributes);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  pid_t child = 0;
  const int failed =
      ::posix_spawn(&child, arguments[0], &actions, &attributes, arguments.data(), environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  return failed == 0 ? std::optional(child) : std::nullopt;
}

/// True if the process ends with exit code 0 in time. If it takes too long, it is killed together
/// with its children.
bool succeeds(pid_t child, const Progress& progress) {
  constexpr std::chrono::milliseconds kPoll{50};
  constexpr std::chrono::seconds kMost{180};
  constexpr std::chrono::duration<double> kUsual{10.0};
  const auto begin = std::chrono::steady_clock::now(), deadline = begin + kMost;
  for (int status = 0;;) {
    const pid_t ended = ::waitpid(child, &status, WNOHANG);
    if (ended == child) return WIFEXITED(status) && WEXITSTATUS(status) == 0;
    if (ended < 0 && errno != EINTR) return false;
    if (std::chrono::steady_clock::now() > deadline) {
      ::kill(-child, SIGKILL);
      ::waitpid(child, &status, 0);
      return false;
    }
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
    progress.show("making the PDF", taken / (taken + kUsual));
    std::this_thread::sleep_for(kPoll);
  }
}

}  // namespace

Result<void> check_pdf(const fs::path& pdf) {
  if (converter({}, {}, {}).empty()) return no_converter();
  return require_place_of(pdf);
}

Result<void> write_pdf(const std::string& html, const fs::path& pdf, const Progress& progress) {
  const WorkFolder work;
  if (work.path().empty())
    return fail(ErrorCode::Io, fmt::format("make a temporary folder: {}", std::strerror(errno)));
  const fs::path page = work.path() / "report.html", made = work.path() / "report.pdf";
  const auto words = converter(page, made, work.path() / "profile");
  if (words.empty()) return no_converter();
  ABBE_TRY(replace_file(page, html));

  const auto child = start_converter(words);
  const bool done = child && succeeds(*child, progress);
  const auto bytes = done ? read_regular_file(made) : Result<std::string>{std::string{}};
  if (!bytes || !bytes->starts_with("%PDF"))
    return fail(ErrorCode::Io, fmt::format("--pdf: {} made no PDF in 3 minutes", words.front()));
  return replace_file(pdf, *bytes);
}

}  // namespace abbe::daemon
