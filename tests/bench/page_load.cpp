// What the page costs: abbed calibrates a simulated machine on the fly in real time
// (calibrated_run.hpp), and ten pages read the events of abbe-web, which posts the positions 50
// times a second. Requirements: no change in the latency of the acquisition threads, no sample
// lost, abbe-web uses at most 5 % of a processor, and each page receives the positions.
// Phases without and with pages alternate in the same run, so that other load on the computer meets
// both alike; abbe-web runs in both.
//   bench_page_load [--short]
// Exit code 1: a requirement is not met (limits: acquisition_comparison.hpp). 2: the run failed. 3:
// inconclusive, because other load changes the latency by more than 1.5.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "abbe/base/file_descriptor.hpp"
#include "acquisition_comparison.hpp"
#include "calibrated_run.hpp"
#include "figure.hpp"

namespace {

using namespace abbe;  // NOLINT(google-build-using-namespace): a program, not a header
using namespace std::chrono_literals;
using bench::AcquisitionPhases;
using bench::CalibratedRun;
using bench::Outcome;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kPages = 10;
constexpr double kLive_hz = 50.0, kMostOfProcessor_percent = 5.0;
constexpr auto kHealthPeriod = 1100ms;  // abbed reads the histograms once a second

/// abbe-web beside abbed.
class Page {
 public:
  explicit Page(CalibratedRun& run)
      : program_(run.start({ABBE_WEB_PROGRAM, "--config", run.file("abbed.toml")}, "web")) {
    run.wait_for("abbe-web", [this] { return port() != 0; });
  }

  [[nodiscard]] std::uint16_t port() const {
    const std::string log = program_->err();
    constexpr std::string_view kBegin = "serving http://127.0.0.1:";
    const auto at = log.find(kBegin);
    if (at == std::string::npos || log.find('\n', at) == std::string::npos) return 0;
    return static_cast<std::uint16_t>(std::stoi(log.substr(at + kBegin.size())));
  }
  /// Fields 14 and 15 of /proc/PID/stat, proc(5).
  [[nodiscard]] double processor_s() const {
    std::ifstream in{fmt::format("/proc/{}/stat", program_->pid())};
    std::string text{std::istreambuf_iterator<char>{in}, {}};
    std::istringstream fields{text.substr(text.rfind(')') + 2)};
    std::string skipped;
    for (int i = 3; i < 14; ++i) fields >> skipped;
    double user = 0.0, system = 0.0;
    fields >> user >> system;
    return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  }

 private:
  std::unique_ptr<test::Program> program_;
};

/// Pages that read the events, all on one thread.
class Readers {
 public:
  explicit Readers(std::uint16_t port) {
    for (std::size_t i = 0; i < kPages; ++i) connections_.push_back(open_page(port));
    thread_ = std::thread([this] { read(); });
  }
  Readers(const Readers&) = delete;
  Readers& operator=(const Readers&) = delete;
  ~Readers() {
    stop_ = true;
    thread_.join();
  }
  /// Events with positions, of all pages.
  [[nodiscard]] std::size_t positions() const { return positions_; }

 private:
  static daemon::FileDescriptor open_page(std::uint16_t port) {
    daemon::FileDescriptor fd{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const std::string request = "GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n";
    const auto* const address = reinterpret_cast<const sockaddr*>(&to);  // NOLINT
    if (::connect(fd.get(), address, sizeof to) != 0 ||
        ::send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL) < 0)
      throw std::runtime_error("abbe-web does not accept a page");
    return fd;
  }

  /// With low priority: the browsers run on other computers.
  void read() {
    constexpr int kNice = 19;
    (void)::setpriority(PRIO_PROCESS, 0, kNice);  // of this thread [Linux]
    std::vector<pollfd> polled;
    for (const auto& fd : connections_) polled.push_back({fd.get(), POLLIN, 0});
    std::array<char, 65536> buffer{};
    while (!stop_) {
      (void)::poll(polled.data(), polled.size(), 100);
      for (const pollfd& page : polled) {
        if ((page.revents & POLLIN) == 0) continue;
        const ssize_t n = ::read(page.fd, buffer.data(), buffer.size());
        if (n > 0) count({buffer.data(), static_cast<std::size_t>(n)});
      }
    }
  }
  void count(std::string_view text) {
    constexpr std::string_view kEvent = "event: live";
    for (auto at = text.find(kEvent); at != std::string_view::npos; at = text.find(kEvent, at + 1))
      ++positions_;
  }

  std::vector<daemon::FileDescriptor> connections_;
  std::atomic<std::size_t> positions_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

struct Cost {
  double processor_s = 0.0, lasted_s = 0.0;
  std::size_t positions = 0;
};

AcquisitionPhases phase(const CalibratedRun& run, std::chrono::seconds lasts) {
  std::this_thread::sleep_for(kHealthPeriod);
  const auto before = run.acquisition();
  std::this_thread::sleep_for(lasts);
  return bench::difference(run.acquisition(), before);
}

AcquisitionPhases phase_with_pages(const CalibratedRun& run, const Page& page,
                                   std::chrono::seconds lasts, Cost& cost) {
  const Readers readers{page.port()};
  const double processor_s = page.processor_s();
  const auto begin = Clock::now();
  auto phases = phase(run, lasts);
  cost.processor_s += page.processor_s() - processor_s;
  cost.lasted_s += std::chrono::duration<double>(Clock::now() - begin).count();
  cost.positions += readers.positions();
  return phases;
}

Outcome report_cost(const Cost& cost) {
  const double percent = 100.0 * cost.processor_s / cost.lasted_s;
  const double rate_hz = static_cast<double>(cost.positions) / cost.lasted_s / kPages;
  tests::print_figure("page, processor time of abbe-web",
                      fmt::format("{:.0f} % of a processor", kMostOfProcessor_percent),
                      "{:.1f} % with {} pages", percent, kPages);
  tests::print_figure("page, positions that a page receives", fmt::format("{:.0f} 1/s", kLive_hz),
                      "{:.1f} 1/s, ratio {:.2f}", rate_hz, rate_hz / kLive_hz);
  constexpr double kMostMissing = 0.9;
  return percent <= kMostOfProcessor_percent && rate_hz >= kMostMissing * kLive_hz
             ? Outcome::Met
             : Outcome::Missed;
}

Outcome measure(const CalibratedRun& run, const Page& page, int pairs, std::chrono::seconds lasts) {
  Cost cost;
  std::map<std::string, bench::AcquisitionComparison> streams;
  for (int i = 0; i < pairs; ++i) {
    for (const auto& [stream, quiet] : phase(run, lasts))
      add(i % 2 == 0 ? streams[stream].quiet_even : streams[stream].quiet_odd, quiet);
    for (const auto& [stream, loaded] : phase_with_pages(run, page, lasts, cost))
      add(streams[stream].requested, loaded);
  }

  Outcome outcome = streams.empty() ? Outcome::Missed : report_cost(cost);
  for (const auto& [stream, of] : streams) outcome = worse(outcome, report_acquisition(stream, of));
  return outcome;
}

}  // namespace

int main(int argc, char** argv) {
  const bool brief = argc > 1 && std::string_view{argv[1]} == "--short";
  try {
    CalibratedRun run{fmt::format("[web]\nport = 0\nlive_hz = {}\n", kLive_hz)};
    const Page page{run};
    run.calibrate();
    return exit_code(measure(run, page, brief ? 2 : 6, brief ? 3s : 8s));
  } catch (const std::exception& error) {
    fmt::print(stderr, "page_load: {}\n", error.what());
    return 2;
  }
}
