// The time until a measuring machine is stopped, whatever the disk does: abbed runs in this process
// and touches with a simulated machine over TCP. During a motion the disk fails (fsync() takes 5 s;
// it is full; it is read-only), and then the machine reports an emergency stop or an error, or a
// client requests a stop. Measured, at the machine's socket: from the bytes of the report (or the
// request of the client) to the bytes of AbortE. The time of both ways over the socket is included.
// The disk is simulated: this program has its own fsync(), fdatasync() and rename().
//   bench_abort_latency [--short]
// Exit code 1: an AbortE later than 20 ms. 2: the run failed.
#include <fmt/format.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "abbe/base/control_protocol.hpp"
#include "abbe/config/config.hpp"
#include "abbe/service/abbed.hpp"
#include "abbe/sim/ippdme_server.hpp"
#include "config_tables.hpp"
#include "figure.hpp"

namespace {

using namespace std::chrono_literals;

enum class Disk { Healthy, Slow, Full, ReadOnly };
std::atomic<Disk> g_disk{Disk::Healthy};
constexpr auto kSlowSync = 5s;

/// What a write-back does on this disk: 0, or the error.
int sync_on_this_disk() {
  const Disk disk = g_disk;
  if (disk == Disk::Full) return ENOSPC;
  if (disk == Disk::ReadOnly) return EROFS;
  const auto until = std::chrono::steady_clock::now() + kSlowSync;
  while (g_disk == Disk::Slow && std::chrono::steady_clock::now() < until)
    std::this_thread::sleep_for(1ms);
  return 0;
}

int done_or(int error) {
  if (error == 0) return 0;
  errno = error;
  return -1;
}

}  // namespace

extern "C" {
int fsync(int fd) {
  const int error = sync_on_this_disk();
  return error == 0 ? static_cast<int>(::syscall(SYS_fsync, fd)) : done_or(error);
}
int fdatasync(int fd) {
  const int error = sync_on_this_disk();
  return error == 0 ? static_cast<int>(::syscall(SYS_fdatasync, fd)) : done_or(error);
}
int rename(const char* from, const char* to) noexcept {
  if (g_disk == Disk::ReadOnly) return done_or(EROFS);
  return static_cast<int>(::syscall(SYS_rename, from, to));
}
}

namespace {

using namespace abbe;  // NOLINT(google-build-using-namespace): a program, not a header
using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr double kAsked_ms = 20.0;
constexpr auto kPatience = 30s;

enum class Cause { EmergencyStop, ErrorReport, Request };

/// The simulated machine in a thread of its own, which notes when the bytes of AbortE arrive.
class Machine {
 public:
  Machine()
      : server_(
            sim::IppDmeServer::open(0, std::make_unique<sim::IppDmeDevice>(options(), clock_.now()))
                .value()),
        thread_([this] { run(); }) {}
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;
  ~Machine() {
    stop_ = true;
    thread_.join();
  }

  [[nodiscard]] std::uint16_t port() const { return server_.port(); }
  [[nodiscard]] bool moving() {
    const std::lock_guard lock{mutex_};
    return server_.device().moving();
  }
  /// Sends the report of the cause and returns when its bytes were given to the socket.
  Clock::time_point report(Cause cause) {
    const std::lock_guard lock{mutex_};
    aborted_.reset();
    if (cause == Cause::EmergencyStop)
      server_.device().press_emergency_stop(clock_.now(), clock_.now() + 1ms);
    if (cause == Cause::ErrorReport)
      server_.device().inject({.kind = sim::FaultKind::ErrorReport, .value = 2}, clock_.now());
    const auto begin = Clock::now();
    server_.poll(clock_.now());
    return begin;
  }
  [[nodiscard]] std::optional<Clock::time_point> aborted() {
    const std::lock_guard lock{mutex_};
    return aborted_;
  }

 private:
  static sim::IppDmeOptions options() {
    sim::IppDmeOptions machine;
    machine.machine.spheres = {{.centre_m = {0.3, 0.3, 0.3}, .radius_m = 12.5e-3}};
    machine.travel_speed_m_s = 0.2e-3;
    return machine;
  }
  void run() {
    while (!stop_) {
      std::array<pollfd, 2> fds{pollfd{server_.listener_fd(), POLLIN, 0},
                                pollfd{server_.client_fd(), POLLIN, 0}};
      ::poll(fds.data(), fds.size(), 1);
      const std::lock_guard lock{mutex_};
      const auto arrived = Clock::now();
      const auto before = aborts();
      server_.poll(clock_.now());
      if (aborts() > before && !aborted_) aborted_ = arrived;
    }
  }
  [[nodiscard]] std::ptrdiff_t aborts() {
    return std::ranges::count(server_.device().heard(), "AbortE()");
  }

  sim::SimClock clock_{1.0};
  sim::IppDmeServer server_;
  std::mutex mutex_;
  std::optional<Clock::time_point> aborted_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

class Folder {
 public:
  Folder() {
    std::string name = std::filesystem::temp_directory_path() / "abbe-abort-XXXXXX";
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no folder");
    path_ = name;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] std::string file(std::string_view name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

template <class Seen>
void wait_until(std::string_view what, Seen seen) {
  for (const auto end = Clock::now() + kPatience; !seen(); std::this_thread::sleep_for(1ms))
    if (Clock::now() > end) throw std::runtime_error(fmt::format("not seen: {}", what));
}

class Run {
 public:
  explicit Run(Machine& machine) : machine_(machine) {
    auto config = daemon::parse_config(
        to_toml(config_tables::half_metre_mill()) +
            fmt::format("[daemon]\ndata_dir = \"{}\"\nruntime_dir = \"{}\"\nsimulated = true\n"
                        "realtime = \"ignore\"\n[dds]\nsupervise = \"off\"\n"
                        "[recording]\nmin_free_MB = 1\n[cmm]\nhost = \"127.0.0.1\"\nport = {}\n",
                        folder_.file("data"), folder_.file("run"), machine.port()),
        folder_.file("abbed.toml"));
    if (!config) throw std::runtime_error(config.error().details.front());
    socket_ = config->control.socket;
    auto started = daemon::Abbed::start(std::move(*config), {});
    if (!started) throw std::runtime_error(started.error().text);
    abbed_ = std::move(*started);
  }

  /// ms from the cause to the bytes of AbortE, in a motion, on this disk.
  double stop_on(Disk disk, Cause cause) {
    wait_until("ready", [this] { return begin_touch(); });
    wait_until("a motion", [this] { return machine_.moving(); });
    g_disk = disk;
    auto begin = machine_.report(cause);
    if (cause == Cause::Request) {
      begin = Clock::now();
      (void)daemon::ask_daemon(socket_, {{"do", "machine"}, {"stop", true}});
    }
    wait_until("AbortE", [this] { return machine_.aborted().has_value(); });
    g_disk = Disk::Healthy;
    wait_until("a release", [this] { return release(); });
    return 1e3 * std::chrono::duration<double>(*machine_.aborted() - begin).count();
  }

 private:
  [[nodiscard]] bool begin_touch() const {
    const json point{{"way", json::array()}, {"at_m", {0.3, 0.3, 0.314}}, {"normal", {0, 0, 1}}};
    return daemon::ask_daemon(socket_, {{"do", "touch"}, {"points", {point}}}).has_value();
  }
  [[nodiscard]] bool release() const {
    return daemon::ask_daemon(socket_, {{"do", "machine"}, {"release", true}}).has_value();
  }

  Machine& machine_;
  Folder folder_;
  std::filesystem::path socket_;
  std::unique_ptr<daemon::Abbed> abbed_;
};

struct Case {
  Disk disk;
  std::string_view name;
};
constexpr std::array kCases{Case{Disk::Healthy, "a healthy disk (reference)"},
                            Case{Disk::Slow, "fsync of 5 s"}, Case{Disk::Full, "a full disk"},
                            Case{Disk::ReadOnly, "a read-only disk"}};

bool measure(Run& run, const Case& on, int repetitions, double& reference_ms) {
  std::vector<double> ms;
  for (int i = 0; i < repetitions; ++i)
    ms.push_back(run.stop_on(on.disk, static_cast<Cause>(i % 3)));
  std::ranges::sort(ms);
  const auto in_time = std::ranges::count_if(ms, [](double t) { return t <= kAsked_ms; });
  const double median = ms[ms.size() / 2];
  if (on.disk == Disk::Healthy) reference_ms = median;
  tests::print_figure(
      fmt::format("AbortE on {}", on.name),
      fmt::format("{:.0f} ms, {} of {}", kAsked_ms, ms.size(), ms.size()),
      "{} of {} in time, longest {:.2f} ms, median {:.2f} ms, {:.2f} of that of the "
      "reference",
      in_time, ms.size(), ms.back(), median, median / reference_ms);
  return in_time == static_cast<std::ptrdiff_t>(ms.size());
}

}  // namespace

int main(int argc, char** argv) {
  const bool brief = argc > 1 && std::string_view{argv[1]} == "--short";
  try {
    Machine machine;
    Run run{machine};
    bool met = true;
    double reference_ms = 0.0;
    for (const Case& on : kCases) met = measure(run, on, brief ? 12 : 102, reference_ms) && met;
    return met ? 0 : 1;
  } catch (const std::exception& error) {
    g_disk = Disk::Healthy;
    fmt::print(stderr, "abort_latency: {}\n", error.what());
    return 2;
  }
}
