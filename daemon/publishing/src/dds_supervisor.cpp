#include "abbe/publishing/dds_supervisor.hpp"

#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <thread>
#include <utility>

#include "abbe/result/try.hpp"

extern char** environ;

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;

/// Makes the attributes of the child independent of the starting thread: no signal is blocked or
/// ignored, and the scheduling is that of `priority`. The threads of the child inherit them.
class SpawnAttributes {
 public:
  explicit SpawnAttributes(int priority) {
    ::posix_spawnattr_init(&attributes_);
    sigset_t none, all;
    ::sigemptyset(&none);
    ::sigfillset(&all);
    ::posix_spawnattr_setsigmask(&attributes_, &none);
    ::posix_spawnattr_setsigdefault(&attributes_, &all);
    sched_param scheduling{};
    scheduling.sched_priority = priority;
    ::posix_spawnattr_setschedpolicy(&attributes_, priority > 0 ? SCHED_FIFO : SCHED_OTHER);
    ::posix_spawnattr_setschedparam(&attributes_, &scheduling);
    ::posix_spawnattr_setflags(
        &attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSCHEDULER);
  }
  ~SpawnAttributes() { ::posix_spawnattr_destroy(&attributes_); }
  SpawnAttributes(const SpawnAttributes&) = delete;
  SpawnAttributes& operator=(const SpawnAttributes&) = delete;
  [[nodiscard]] const posix_spawnattr_t* get() const { return &attributes_; }

 private:
  posix_spawnattr_t attributes_{};
};

/// Clears the ambient capabilities that abbed has for real time from its unit (CAP_SYS_NICE,
/// CAP_IPC_LOCK): abbe-dds receives data from the network and must not have them. Only started
/// programs are affected; this process keeps its capabilities.
void keep_capabilities_from_children() {
  ::prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL, 0UL, 0UL, 0UL);
}

}  // namespace

Result<DdsSupervisor> DdsSupervisor::start(Options options, WallTime now) {
  // With this argument abbe-dds ends after abbed has ended, once it has published the loss to its
  // subscribers.
  options.arguments.insert(options.arguments.end(), {"--parent", std::to_string(::getpid())});
  DdsSupervisor supervisor(std::move(options));
  ABBE_TRY(supervisor.spawn(now));
  return supervisor;
}

DdsSupervisor::DdsSupervisor(DdsSupervisor&& other) noexcept
    : options_(std::move(other.options_)),
      pid_(std::exchange(other.pid_, 0)),
      started_(other.started_),
      next_start_(other.next_start_),
      delay_(other.delay_),
      restarts_(other.restarts_),
      hung_(other.hung_),
      last_end_(other.last_end_),
      start_fault_(std::move(other.start_fault_)) {}

DdsSupervisor& DdsSupervisor::operator=(DdsSupervisor&& other) noexcept {
  if (this == &other) return *this;
  stop();
  options_ = std::move(other.options_);
  pid_ = std::exchange(other.pid_, 0);
  started_ = other.started_;
  next_start_ = other.next_start_;
  delay_ = other.delay_;
  restarts_ = other.restarts_;
  hung_ = other.hung_;
  last_end_ = other.last_end_;
  start_fault_ = std::move(other.start_fault_);
  return *this;
}

DdsSupervisor::~DdsSupervisor() {
  stop();
}

Result<void> DdsSupervisor::spawn(WallTime now) {
  std::string program = options_.program.string();
  std::vector<char*> argv{program.data()};
  for (std::string& argument : options_.arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  keep_capabilities_from_children();
  pid_t child = 0;

  const auto start = [&](int priority) {
    const SpawnAttributes attributes(priority);
    return ::posix_spawn(&child, program.c_str(), nullptr, attributes.get(), argv.data(), environ);
  };

  int error = start(options_.priority);
  if (error == EPERM && options_.priority > 0) error = start(0);
  if (error != 0) return fail(ErrorCode::Io, "start " + program + ": " + std::strerror(error));
  pid_ = child;
  started_ = now;
  hung_ = false;
  if (options_.process != nullptr) options_.process->started(child, now);

  return {};
}

void DdsSupervisor::kill_if_hung() noexcept {
  if (options_.process == nullptr || hung_) return;
  const DdsProcess& process = *options_.process;
  const auto limit = process.has_answered() ? options_.hung_after : options_.hung_at_start;
  if (process.silent_for() <= limit) return;
  hung_ = true;
  ::kill(pid_, SIGKILL);
}

bool DdsSupervisor::reap(WallTime now) {
  int status = 0;
  if (::waitpid(pid_, &status, WNOHANG) != pid_) return false;
  pid_ = 0;
  last_end_ = DdsEnd{status, hung_, std::chrono::system_clock::now()};
  if (options_.process != nullptr) options_.process->ended(*last_end_);
  const bool ended_at_start = now - started_ < options_.steady_after;
  // After a signal (crash) the delay stays short, because the crash may not recur. The cause of an
  // exit usually persists, so the delay grows.
  const auto longest = WIFSIGNALED(status) ? options_.first_delay : options_.longest_delay;
  delay_ = ended_at_start ? std::clamp(2 * delay_, options_.first_delay, longest) : 0ms;
  next_start_ = now + delay_;
  return true;
}

void DdsSupervisor::poll(WallTime now) {
  if (pid_ != 0) {
    kill_if_hung();
    if (!reap(now)) return;
  }

  if (now < next_start_) return;
  if (const auto started = spawn(now); !started) {
    start_fault_ = started.error().text;
    delay_ = options_.longest_delay;
    next_start_ = now + delay_;
    return;
  }

  start_fault_.clear();
  ++restarts_;
  if (options_.process != nullptr) options_.process->restarted();
}

void DdsSupervisor::stop() noexcept {
  if (pid_ == 0) return;
  ::kill(pid_, SIGTERM);
  const auto deadline = std::chrono::steady_clock::now() + options_.stop_patience;
  while (::waitpid(pid_, nullptr, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() > deadline) ::kill(pid_, SIGKILL);
    std::this_thread::sleep_for(std::chrono::milliseconds{2});
  }
  pid_ = 0;
}

}  // namespace abbe::daemon
