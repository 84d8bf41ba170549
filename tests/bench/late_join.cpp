// The time until a Cyclone DDS subscriber that joins late receives ModelState: from the start of
// its process (the example program for Cyclone DDS) to the first state that it prints. Discovery is
// by unicast on loopback, which is slower than multicast.
//   bench_late_join [--short]
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/messages/cdr.hpp"
#include "abbe/messages/dds_link.hpp"
#include "abbe/publishing/dds_supervisor.hpp"

extern char** environ;

namespace {

using namespace std::chrono_literals;
using namespace abbe;
using Clock = std::chrono::steady_clock;

constexpr double kMedian_s = 0.3, kWorst_s = 1.0;  // required
constexpr auto kPatience = 5s;

/// Takes the place of abbed: publishes a ModelState every second and a compensation vector every
/// 10 ms.
class Publisher {
 public:
  explicit Publisher(daemon::DdsLink link) : link_(std::move(link)) {}

  void cycle() {
    const auto now = Clock::now();
    link_.poll();
    if (now >= next_state_) {
      v1::ModelState state;
      state.machine("bench");
      state.state(v1::MODEL_ACTIVE);
      state.sequence_number(++sequence_);
      send(daemon::Topic::ModelState, state);
      next_state_ = now + 1s;
    }

    if (now >= next_vector_) {
      v1::Compensation vector;
      vector.machine("bench");
      send(daemon::Topic::Compensation, vector);
      next_vector_ = now + 10ms;
    }

    link_.beat(now);
  }

 private:
  template <class T>
  void send(daemon::Topic topic, const T& message) {
    if (daemon::encode(message, payload_)) link_.publish(topic, payload_);
  }

  daemon::DdsLink link_;
  std::vector<std::byte> payload_;
  std::uint64_t sequence_ = 0;
  Clock::time_point next_state_{}, next_vector_{};
};

/// A process whose standard output is read through a pipe.
class Subscriber {
 public:
  explicit Subscriber(std::string domain) {
    std::string program = ABBE_CYCLONE_SUBSCRIBER;
    std::array<char*, 3> argv{program.data(), domain.data(), nullptr};
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) std::abort();
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    if (::posix_spawn(&pid_, program.c_str(), &actions, nullptr, argv.data(), environ) != 0)
      std::abort();
    ::posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
    output_ = ends[0];
  }
  ~Subscriber() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
    ::close(output_);
  }
  Subscriber(const Subscriber&) = delete;
  Subscriber& operator=(const Subscriber&) = delete;

  /// Waits at most 1 ms for further output.
  bool printed(std::string_view what) {
    pollfd ready{output_, POLLIN, 0};
    std::array<char, 4096> chunk{};
    if (::poll(&ready, 1, 1) > 0) {
      const ssize_t n = ::read(output_, chunk.data(), chunk.size());
      if (n > 0) text_.append(chunk.data(), static_cast<std::size_t>(n));
    }
    return text_.find(what) != std::string::npos;
  }

 private:
  pid_t pid_ = 0;
  int output_ = -1;
  std::string text_;
};

/// Starts a subscriber and returns the time until its first state, in seconds; nullopt if no state
/// arrived in time.
std::optional<double> join(Publisher& publisher, const std::string& domain) {
  const auto start = Clock::now();
  Subscriber subscriber(domain);
  while (!subscriber.printed("bench: state")) {
    publisher.cycle();
    if (Clock::now() - start > kPatience) return std::nullopt;
  }
  return std::chrono::duration<double>(Clock::now() - start).count();
}

int measure(Publisher& publisher, const std::string& domain, std::size_t joins) {
  // the first measurement is not used, because abbe-dds itself starts during it
  static_cast<void>(join(publisher, domain));
  std::vector<double> joined_s;
  std::size_t missed = 0;

  for (std::size_t i = 0; i < joins; ++i) {
    if (const auto s = join(publisher, domain)) {
      joined_s.push_back(*s);
    } else {
      ++missed;
    }
  }

  if (joined_s.empty()) return 1;
  std::ranges::sort(joined_s);
  const double median_s = joined_s[joined_s.size() / 2], worst_s = joined_s.back();

  const auto row = [](const char* what, double asked, double measured) {
    fmt::print("  {:<20} {:>6.3f} s  asked <= {:.1f} s  {}\n", what, measured, asked,
               measured <= asked ? "held" : "MISSED");
  };

  fmt::print("Cyclone DDS subscribers that join late: {}, of which {} got no state in {} s\n",
             joins, missed, kPatience.count());
  row("median", kMedian_s, median_s);
  row("95 of 100", kWorst_s, joined_s[joined_s.size() * 95 / 100]);
  row("worst", kWorst_s, worst_s);

  return missed == 0 && median_s <= kMedian_s && worst_s <= kWorst_s ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  const bool is_short = argc > 1 && std::string_view(argv[1]) == "--short";
  ::setenv("CYCLONEDDS_URI", "file://" ABBE_CYCLONE_CONFIG, 1);
  std::string name = (std::filesystem::temp_directory_path() / "abbe-bench.XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) std::abort();
  const std::filesystem::path socket = std::filesystem::path(name) / "dds.sock";
  const std::string domain = std::to_string(::getpid() % 100 + 1);
  int result = 1;

  if (auto link = daemon::DdsLink::listen(socket)) {
    auto dds = daemon::DdsSupervisor::start(
        {.program = ABBE_DDS_PROGRAM,
         .arguments = {"--socket", socket, "--domain", domain, "--profile", ABBE_LOOPBACK_PROFILE}},
        Clock::now());
    Publisher publisher(std::move(*link));
    if (dds) result = measure(publisher, domain, is_short ? 30 : 200);
  }

  std::filesystem::remove_all(name);
  return result;
}
