#include "abbe/web/replays.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <exception>
#include <system_error>
#include <utility>
#include <vector>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/file_descriptor.hpp"
#include "abbe/result/try.hpp"
#include "abbe/web/recording_list.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::FileDescriptor;
using daemon::Result;

constexpr std::size_t kLongestOutput = 4u << 20;
constexpr int kLowPriority = 19;
constexpr std::chrono::minutes kLongestReplay{60};
constexpr int kPollPeriod_ms = 1000;

struct Child {
  pid_t pid = 0;
  FileDescriptor output;
};

/// Starts the program with its standard output and error in a pipe.
Result<Child> start_child(std::vector<std::string> command) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0)
    return daemon::fail(ErrorCode::Io, fmt::format("pipe: {}", std::strerror(errno)));
  FileDescriptor read_end{ends[0]}, write_end{ends[1]};

  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  for (const int fd : {STDOUT_FILENO, STDERR_FILENO})
    ::posix_spawn_file_actions_adddup2(&actions, write_end.get(), fd);
  ::posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);
  // abbe-web blocks the signals that stop it; the child must not inherit that.
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);

  std::vector<char*> arguments;
  for (std::string& word : command) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t pid = 0;
  const int failed =
      ::posix_spawnp(&pid, arguments[0], &actions, &attributes, arguments.data(), environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  if (failed != 0)
    return daemon::fail(ErrorCode::Io,
                        fmt::format("start {}: {}", command.front(), std::strerror(failed)));
  (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(pid), kLowPriority);
  return Child{.pid = pid, .output = std::move(read_end)};
}

/// What the child writes until it ends; after kLongestReplay it is killed.
std::string all_output(int fd, pid_t child) {
  const auto until = std::chrono::steady_clock::now() + kLongestReplay;
  std::string text;
  std::array<char, 65536> buffer;  // NOLINT: read() fills what is used
  for (bool killed = false;;) {
    pollfd polled{.fd = fd, .events = POLLIN, .revents = 0};
    const int ready = ::poll(&polled, 1, kPollPeriod_ms);
    if (!killed && std::chrono::steady_clock::now() > until) {
      ::kill(child, SIGKILL);
      killed = true;
      text = fmt::format("abbe replay took longer than {} min and was ended",
                         std::chrono::duration_cast<std::chrono::minutes>(kLongestReplay).count());
    }
    if (ready <= 0) continue;
    const ssize_t n = ::read(fd, buffer.data(), buffer.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return text;
    if (!killed && text.size() < kLongestOutput)
      text.append(buffer.data(), static_cast<std::size_t>(n));
  }
}

/// What `abbe replay --json` printed; lines before the JSON object are its messages.
nlohmann::json result_json(const std::string& output) {
  const auto begin = output.find('{');
  if (begin == std::string::npos) return {{"state", "failed"}, {"error", output}};
  auto result = daemon::parse_json(output.substr(begin), "abbe replay");
  if (!result) return {{"state", "failed"}, {"error", output}};
  return {{"state", "done"}, {"result", std::move(*result)}};
}

}  // namespace

Replays::~Replays() {
  {
    const std::lock_guard lock(mutex_);
    if (child_ != 0) ::kill(child_, SIGKILL);
  }
  if (thread_.joinable()) thread_.join();
}

Result<void> Replays::begin(const std::string& name) {
  ABBE_TRY(open_recording(folder_, name));
  const std::lock_guard lock(mutex_);
  if (child_ != 0)
    return daemon::fail(ErrorCode::Refused, "another recording is being replayed: wait for it");
  if (thread_.joinable()) thread_.join();

  auto child = start_child({program_.string(), "replay", (folder_ / name).string(), "--json"});
  ABBE_TRY(child);
  const pid_t pid = child->pid;
  try {
    thread_ =
        std::thread([this, child = std::move(*child)] { follow(child.output.get(), child.pid); });
  } catch (const std::system_error& error) {  // TasksMax of the unit
    ::kill(pid, SIGKILL);
    (void)::waitpid(pid, nullptr, 0);
    return daemon::fail(ErrorCode::Io, fmt::format("replay of {}: no thread can be started: {}",
                                                   name, error.code().message()));
  }
  child_ = pid;
  status_ = {{"state", "running"}, {"name", name}};
  return {};
}

void Replays::follow(int output_fd, pid_t child) {
  nlohmann::json result;
  try {
    result = result_json(all_output(output_fd, child));
  } catch (const std::exception& error) {  // for example no memory for the output
    ::kill(child, SIGKILL);
    result = {{"state", "failed"}, {"error", error.what()}};
  }
  // The child remains a zombie until child_ is 0, so that its id is not that of another process.
  siginfo_t ended{};
  while (::waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOWAIT) != 0 &&
         errno == EINTR) {
  }
  const std::lock_guard lock(mutex_);
  child_ = 0;
  (void)::waitpid(child, nullptr, 0);
  result["name"] = status_["name"];
  status_ = std::move(result);
}

nlohmann::json Replays::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace abbe::web
