// From the wire to DDS: the delay from the last TPDO of a cycle, or the last byte of a burst,
// leaving the simulated device until a subscriber in another process has the sample, through abbed
// and abbe-dds as installed. This delay is compared with that of a plain Fast DDS hop (dds_hop.hpp)
// of the same period. The hop runs at the same time, because a shared computer wakes a sleeping
// process within 30 us in one minute and within 200 us in the next; it is shifted by half a cycle,
// when abbe only polls its rings. The hop is also measured alone, before abbe starts, and printed.
// The main loop of abbed (hub) polls every P, so a sample waits P/2 on average and P at most before
// it is processed. Other load on the computer increases the largest delays of both; with `nice -n
// -20 bench_wire_to_dds`, abbe and the hop have priority over this load.
//   bench_wire_to_dds [--short]
#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config_tables.hpp"
#include "dds_hop.hpp"
#include "forked_task.hpp"
#include "snapshot_log.hpp"
#include "stamped_stage.hpp"

extern char** environ;

namespace {

using namespace abbe::bench;  // NOLINT(google-build-using-namespace): a program, not a header
using namespace std::chrono_literals;
namespace config_tables = abbe::config_tables;
namespace fs = std::filesystem;

constexpr auto kHubPeriod = 250us;
// About 100 Hz, so that the processors are idle between two cycles. Not a multiple of the hub's
// period P: SYNC and hub run on the same clock, and with a multiple a sample would wait for the hub
// equally long in every cycle.
constexpr auto kSyncPeriod = 10'007us;
constexpr std::int64_t kHalfPeriod_ns = std::chrono::nanoseconds{kSyncPeriod}.count() / 2;
constexpr double kHops = 3.0;  // the limits: median P/2 + 3 hops, p99 P + 3 hops
constexpr std::int64_t kLongest_ns = 200'000'000;

struct Plan {
  std::size_t cycles = 6500;
  std::size_t bursts = 200;
  std::size_t hops_alone = 700;
  std::size_t hops_beside = 6200;  ///< hops during the run of abbe; must not last longer than that
};

double us(std::int64_t ns) {
  return 1e-3 * static_cast<double>(ns);
}

struct Quantiles {
  std::size_t n = 0;
  double p50 = 0.0, p99 = 0.0;
};

Quantiles quantiles(std::vector<double> values) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  const std::size_t n = values.size();
  return {n, values[n / 2], values[std::min(n - 1, n * 99 / 100)]};
}

/// Results for the samples of one device, us.
struct Path {
  std::vector<double> sending, to_hub, hub_to_subscriber, whole;
  std::size_t lost = 0;        ///< departures without an arrival
  std::size_t impossible = 0;  ///< arrivals before the departure
};

// -------------------------------------------------------------------------------------------------
// matching departures and arrivals

/// The publishing cycle of the hub to which an arrival belongs: the last cycle before the arrival.
const HubCycle* turn_of(const SnapshotLog& log, std::int64_t arrived_ns, std::int64_t left_ns) {
  const HubCycle* found = nullptr;
  for (std::size_t i = 0; i < log.turns.size(); ++i) {
    const HubCycle& turn = log.turns[i];
    if (turn.hub_ns <= arrived_ns && turn.hub_ns >= left_ns &&
        (found == nullptr || turn.hub_ns > found->hub_ns))
      found = &turn;
  }
  return found;
}

void note(Path& path, const SnapshotLog& log, const Departure& departure, std::int64_t arrived_ns) {
  if (arrived_ns < departure.before_ns) ++path.impossible;
  path.sending.push_back(us(departure.after_ns - departure.before_ns));
  path.whole.push_back(us(arrived_ns - departure.before_ns));
  if (const HubCycle* turn = turn_of(log, arrived_ns, departure.before_ns)) {
    path.to_hub.push_back(us(turn->hub_ns - departure.before_ns));
    path.hub_to_subscriber.push_back(us(arrived_ns - turn->hub_ns));
  }
}

/// Results for the encoders. Arrivals and departures are matched by time: the sample of a cycle
/// carries the time of the SYNC, shortly before the TPDOs of the cycle were sent.
Path encoder_path(const SnapshotLog& log, const std::vector<Departure>& cycles) {
  Path path;
  std::size_t i = 0;
  for (const Departure& cycle : cycles) {
    while (i < log.arrivals.size() &&
           log.arrivals[i].host_time_ns < cycle.before_ns - kHalfPeriod_ns)
      ++i;
    if (i == log.arrivals.size() || log.arrivals[i].host_time_ns > cycle.after_ns) {
      ++path.lost;
    } else {
      note(path, log, cycle, log.arrivals[i].arrived_ns);
    }
  }

  return path;
}

/// Results for the tracker. A burst has arrived with the first snapshot that contains its last
/// point, which is the newest point in all snapshots received before the next burst was sent.
Path tracker_path(const SnapshotLog& log, const std::vector<Departure>& bursts) {
  Path path;
  std::size_t i = 0;
  for (const Departure& burst : bursts) {
    const Arrival* last = nullptr;
    std::int64_t before = 0;
    for (; i < log.arrivals.size() && log.arrivals[i].arrived_ns < burst.before_ns; ++i)
      before = log.arrivals[i].tracker_device_time_ns;
    for (std::size_t k = i;
         k < log.arrivals.size() && log.arrivals[k].arrived_ns < burst.before_ns + kLongest_ns;
         ++k) {
      const Arrival& arrival = log.arrivals[k];
      if (arrival.tracker_device_time_ns >
          (last != nullptr ? last->tracker_device_time_ns : before))
        last = &arrival;
    }
    if (last == nullptr) {
      ++path.lost;
    } else {
      note(path, log, burst, last->arrived_ns);
    }
  }

  return path;
}

// -------------------------------------------------------------------------------------------------
// abbed, as it is installed

/// The folder of one run, removed at the end unless something failed.
class RunFolder {
 public:
  RunFolder() {
    std::string name = (fs::temp_directory_path() / "abbe-bench.XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  ~RunFolder() {
    std::error_code ignored;
    if (!keep_) fs::remove_all(path_, ignored);
  }
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;
  void keep() { keep_ = true; }
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
  bool keep_ = false;
};

std::string configuration(const StampedStage& stage, std::uint32_t domain) {
  const config_tables::Machine machine{.name = "bench",
                                       .x = {-300, 300},
                                       .y = {-250, 250},
                                       .z = {-400, 0},
                                       .target_offset_mm = {{20, -15, -120}},
                                       .node_spacing_mm = 50};

  return to_toml(machine) + to_toml(config_tables::Tracker{.port = stage.tracker_port()}) +
         to_toml(config_tables::Encoder{
             .peer_port = stage.can_port(),
             .sync_period_us = std::chrono::microseconds{kSyncPeriod}.count(),
             .step_nm = 10}) +
         std::string{config_tables::kDaemonInItsFolder} +
         fmt::format("hub_period_us = {}\n[recording]\nmin_free_MB = 16\n",
                     std::chrono::microseconds{kHubPeriod}.count()) +
         to_toml(config_tables::Dds{.domain = std::to_string(domain),
                                    .profile = ABBE_LOOPBACK_PROFILE,
                                    .more = "snapshot_hz = 0\ncompensation_hz = 0\n"});
}

/// The process abbed. stop() sends SIGTERM, as systemd does.
class Daemon {
 public:
  explicit Daemon(const fs::path& folder) {
    std::string program = ABBE_ABBED, flag = "--config", config = (folder / "abbed.toml").string();
    std::array<char*, 4> argv{program.data(), flag.data(), config.data(), nullptr};
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, (folder / "abbed.log").c_str(),
                                       O_WRONLY | O_CREAT, 0600);
    posix_spawnattr_t ordinary;
    ::posix_spawnattr_init(&ordinary);
    const sched_param none{};
    ::posix_spawnattr_setschedpolicy(&ordinary, SCHED_OTHER);
    ::posix_spawnattr_setschedparam(&ordinary, &none);
    ::posix_spawnattr_setflags(&ordinary, POSIX_SPAWN_SETSCHEDULER);

    if (::posix_spawn(&pid_, program.c_str(), &actions, &ordinary, argv.data(), environ) != 0)
      pid_ = 0;
    ::posix_spawnattr_destroy(&ordinary);
    ::posix_spawn_file_actions_destroy(&actions);
  }
  ~Daemon() { stop(); }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;
  void stop() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGTERM);
    ::waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }

 private:
  pid_t pid_ = 0;
};

// -------------------------------------------------------------------------------------------------
// the run

bool cycle_until(StampedStage& stage, std::chrono::seconds patience,
                 const std::function<bool()>& done) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!done()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    stage.cycle();
  }
  return true;
}

bool both_flow(const SnapshotLog& log) {
  const std::size_t n = log.arrivals.size();
  return n > 0 && log.turns.size() > 0 && log.arrivals[n - 1].tracker_device_time_ns != 0;
}

/// The whole chain, from the first SYNC to the last arrival. Returns false after an error, reported
/// on stderr.
bool run_chain(StampedStage& stage, SnapshotLog& log, ForkedTask& subscriber,
               const std::function<void(std::int64_t away_ns)>& begin_hop, std::uint32_t domain,
               const Plan& plan) {
  RunFolder folder;
  std::ofstream(folder.path() / "abbed.toml") << configuration(stage, domain);
  subscriber.begin();
  Daemon daemon(folder.path());
  if (!cycle_until(stage, 60s, [&] { return log.failed || both_flow(log); }) || log.failed) {
    fmt::print(stderr, "bench_wire_to_dds: no samples from both devices; see {}\n",
               folder.path().string());
    folder.keep();
    return false;
  }
  stage.forget();
  cycle_until(stage, 5s, [&] { return !stage.cycles().empty(); });
  if (!stage.cycles().empty()) begin_hop(stage.cycles().back().before_ns + kHalfPeriod_ns);
  // before the measurement, the clock model, the caches and DDS discovery need this time
  const auto settled = std::chrono::steady_clock::now() + 3s;
  cycle_until(stage, 10s, [&] { return std::chrono::steady_clock::now() > settled; });
  stage.forget();
  const auto enough = [&] {
    return stage.cycles().size() >= plan.cycles && stage.bursts().size() >= plan.bursts;
  };
  const bool complete = cycle_until(stage, 120s, enough);
  const Departure last = stage.cycles().empty() ? Departure{} : stage.cycles().back();
  const auto cycles = stage.cycles().size(), bursts = stage.bursts().size();
  cycle_until(stage, 2s, [&] { return monotonic_ns() > last.after_ns + kLongest_ns; });
  if (!complete)
    fmt::print(stderr, "bench_wire_to_dds: only {} cycles and {} bursts\n", cycles, bursts);
  daemon.stop();
  log.stop = true;
  subscriber.wait();
  return complete;
}

/// Gives this process, which simulates the devices, a higher priority than everything measured,
/// because a real device does not wait for a processor. Returns false if this is not permitted.
bool stand_for_hardware() {
  ::prctl(PR_SET_TIMERSLACK, 1UL);
  const sched_param first{.sched_priority = 80};
  return ::sched_setscheduler(0, SCHED_FIFO, &first) == 0;
}

std::string load_average() {
  std::array<double, 1> load{};
  return ::getloadavg(load.data(), 1) == 1 ? fmt::format("{:.2f}", load[0]) : "unknown";
}

/// The share of the time between two calls in which the processors were idle. If this share is near
/// zero, p99 of the delay is the time slice that the scheduler gave another program (about 3 ms),
/// not the delay of abbe.
class IdleShare {
 public:
  IdleShare() { read(); }
  double percent() {
    const double idle = idle_, all = all_;
    read();
    return all_ > all ? 100.0 * (idle_ - idle) / (all_ - all) : 0.0;
  }

 private:
  void read() {
    std::ifstream in("/proc/stat");
    std::string cpu;
    in >> cpu;
    all_ = 0.0;
    double ticks = 0.0;
    for (int column = 0; column < 8 && in >> ticks;
         ++column) {  // user nice system idle iowait irq softirq steal
      all_ += ticks;
      if (column == 3) idle_ = ticks;
    }
  }
  double idle_ = 0.0, all_ = 0.0;
};

/// Prints the delays. True if the limits for median and p99, computed with the simultaneous hop,
/// are met.
bool print_verdict(std::string_view what, const Path& path, const HopResult& hop,
                   const HopResult& alone) {
  const double P = us(std::chrono::nanoseconds{kHubPeriod}.count());
  const Quantiles q = quantiles(path.whole);
  const double asked50 = P / 2 + kHops * hop.p50_us;
  const double asked99 = P + kHops * hop.p99_us;
  const double strict99 = P + kHops * hop.p50_us;

  const auto row = [&](std::string_view name, double asked, double measured) {
    fmt::print("  {:<8} {:<30} {:>8.1f} {:>9.1f}   {:>5.2f}  {}\n", what, name, asked, measured,
               measured / asked, measured <= asked ? "held" : "MISSED");
  };

  row("p50 <= P/2 + 3 hop p50", asked50, q.p50);
  row("p99 <= P + 3 hop p99", asked99, q.p99);
  row("p99 <= P + 3 hop p50 (stricter)", strict99, q.p99);
  row("p50, by the hop alone before", P / 2 + kHops * alone.p50_us, q.p50);
  if (path.lost > 0)
    fmt::print("  {:<8} {} of {} without an arrival\n", what, path.lost, path.lost + q.n);
  if (path.impossible > 0)
    fmt::print("  {:<8} {} arrived before they left\n", what, path.impossible);

  return path.impossible == 0 && q.n > 0 && q.p50 <= asked50 && q.p99 <= asked99;
}

void print_shares(std::string_view what, const Path& path, const DeviceLatency& device,
                  const HopResult& hop) {
  const double P = us(std::chrono::nanoseconds{kHubPeriod}.count());
  const Quantiles sending = quantiles(path.sending), to_hub = quantiles(path.to_hub),
                  out = quantiles(path.hub_to_subscriber);

  const auto row = [&](std::string_view share, std::string p50, std::string p99,
                       std::string_view how) {
    fmt::print("  {:<8} {:<36} {:>7} {:>8}   {}\n", what, share, p50, p99, how);
  };

  const auto number = [](double v) { return fmt::format("{:.1f}", v); };
  row("leaving the simulator to the hub", number(to_hub.p50), number(to_hub.p99), "measured");
  row("  bytes to ring, real-time part", number(1e6 * device.p50_s), number(1e6 * device.p99_s),
      "the daemon's own");
  row("  ring: waiting for the hub", number(P / 2), number(P * 0.99), "uniform over P, assumed");
  row("  sending, wire, waking the device", number(to_hub.p50 - P / 2 - 1e6 * device.p50_s), "-",
      "the difference");
  row("    the simulator's call alone", number(sending.p50), number(sending.p99), "measured");
  row("hub to subscriber", number(out.p50), number(out.p99), "measured");
  row("  DDS: the bare hop", number(hop.p50_us), number(hop.p99_us), "measured beside");
  row("  hub's encoding, socket, abbe-dds", number(out.p50 - hop.p50_us), "-", "the difference");
}

}  // namespace

int main(int argc, char** argv) {
  Plan plan;
  if (argc > 1 && std::string_view(argv[1]) == "--short") plan = {300, 8, 200, 250};
  const auto domain = static_cast<std::uint32_t>(::getpid() % 200 + 1);
  const auto hop_of = [domain](std::size_t samples, std::int64_t phase_ns) {
    return HopOptions{.samples = samples,
                      .warm_up = 20,
                      .period = kSyncPeriod,
                      .phase = std::chrono::nanoseconds{phase_ns},
                      .domain = domain + 1,
                      .profile = ABBE_LOOPBACK_PROFILE};
  };

  // All processes are forked here, before any thread is started.
  auto& alone = shared_memory<HopResult>();
  auto& beside = shared_memory<HopResult>();
  auto& log = shared_memory<SnapshotLog>();
  auto& away_ns = shared_memory<std::int64_t>();
  ForkedTask hop_alone([&] { alone = measure_dds_hop(hop_of(plan.hops_alone, 0)); });
  ForkedTask hop_beside([&] { beside = measure_dds_hop(hop_of(plan.hops_beside, away_ns)); });
  ForkedTask subscriber([&] { subscribe(log, {domain, ABBE_LOOPBACK_PROFILE}); });

  const std::string load_before = load_average();
  hop_alone.begin();
  hop_alone.wait();
  const bool device_is_prompt = stand_for_hardware();
  auto stage = StampedStage::open();
  if (!stage) {
    fmt::print(stderr, "bench_wire_to_dds: {}\n", stage.error().text);
    return 1;
  }
  IdleShare idle;
  const auto begin_hop = [&](std::int64_t phase_ns) {
    away_ns = phase_ns;
    hop_beside.begin();
  };
  if (!run_chain(**stage, log, subscriber, begin_hop, domain, plan)) return 1;
  const double idle_percent = idle.percent();
  hop_beside.wait();
  if (alone.received == 0 || beside.received == 0) {
    fmt::print(stderr, "bench_wire_to_dds: the bare hop found no subscriber\n");
    return 1;
  }

  if (!device_is_prompt)
    fmt::print("the simulator runs without SCHED_FIFO: its own delays count against abbe\n");
  const Path encoder = encoder_path(log, (*stage)->cycles());
  const Path tracker = tracker_path(log, (*stage)->bursts());
  fmt::print(
      "wire to DDS: hub period P {} us, SYNC every {} us, {} cycles, {} bursts of 166 points; load "
      "{} "
      "before, {} after, processors {:.0f} % idle meanwhile\n",
      kHubPeriod.count(), std::chrono::microseconds{kSyncPeriod}.count(), encoder.whole.size(),
      tracker.whole.size(), load_before, load_average(), idle_percent);
  fmt::print(
      "bare Fast DDS hop, {} B every {} us, us: p50 {:.1f} p99 {:.1f} beside, p50 {:.1f} p99 "
      "{:.1f} alone "
      "before\n\n",
      hop::kMessageBytes, std::chrono::microseconds{kSyncPeriod}.count(), beside.p50_us,
      beside.p99_us, alone.p50_us, alone.p99_us);
  fmt::print("  {:<8} {:<30} {:>8} {:>9}   {:>5}\n", "device", "limit, us", "asked", "measured",
             "ratio");
  const bool encoder_held = print_verdict("encoder", encoder, beside, alone);
  const bool tracker_held = print_verdict("tracker", tracker, beside, alone);
  fmt::print("\n  {:<8} {:<36} {:>7} {:>8}\n", "device", "share, us", "p50", "p99");
  print_shares("encoder", encoder, log.encoder, beside);
  print_shares("tracker", tracker, log.tracker, beside);
  return encoder_held && tracker_held ? 0 : 1;
}
