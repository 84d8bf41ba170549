// The longest cycle of the hub, abbed's main loop, with the largest permitted inputs: models with
// the maximum number of parameters that can be published, with covariance, become active (this is
// checked); a request of almost 4 MB, a path of 1e5 vertices, arrives on the control socket; the
// machine drives the whole path, measured by a tracker in bursts of 332 points, and the run is
// identified; status requests arrive as fast as they are answered. A thread of the highest priority
// on the hub's processor wakes every 100 us. If this thread wakes late, no thread ran on the
// processor, because the hypervisor gave it to another guest. This time is printed and subtracted
// from the hub's cycle. The processor time of the longest cycle is printed as well.
//   bench_hub_cycle [--short]          as root, or with CAP_SYS_NICE, for real-time priority
// Exit code 1: a cycle longer than 2 ms, or a model that did not become active.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <random>
#include <string_view>
#include <thread>

#include "abbe/calib/model/interpolation_grid.hpp"
#include "abbe/calib/otf/plan/plan.hpp"
#include "abbe/drivers/real_time_memory.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/service/background_tasks.hpp"
#include "abbe/service/control_api.hpp"
#include "abbe/service/hub.hpp"
#include "config_tables.hpp"
#include "figure.hpp"
#include "synthetic_model.hpp"

namespace {

using namespace abbe;  // NOLINT(google-build-using-namespace): a program, not a header
using namespace std::chrono_literals;
using daemon::Hub;
using nlohmann::json;
using protocol::HostTime;
using std::chrono::nanoseconds;
using Clock = std::chrono::steady_clock;

constexpr auto kPeriod = 250us;
constexpr auto kAsked = 2ms;
constexpr auto kLook = 100us;
constexpr int kPriority = 30, kHighestPriority = 99;
constexpr int kCpu = 1;  // the hub's processor
constexpr std::size_t kVertices = 100'000;
constexpr std::size_t kBurst = 332;            // points of one packet: 1 kHz, every 332 ms
constexpr std::size_t kMostParameters = 1024;  // limit of ErrorModel in the IDL
constexpr std::size_t kMostGridNodes = 4096;   // limit of a published grid

std::int64_t cpu_ns() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

/// The longest cycle since the last reset(). Written by one thread; read and reset by another.
struct Longest {
  std::atomic<std::int64_t> wall_ns{0}, cycle_ns{0}, cpu_ns{0};
  std::atomic<std::uint64_t> cycles{0};

  /// `cycle`: wall time without the time in which the hypervisor took the processor away.
  void take(std::int64_t wall, std::int64_t cycle, std::int64_t cpu) {
    if (wall > wall_ns) wall_ns = wall;
    if (cycle > cycle_ns) cycle_ns = cycle;
    if (cpu > cpu_ns) cpu_ns = cpu;
    ++cycles;
  }
  void reset() { wall_ns = 0, cycle_ns = 0, cpu_ns = 0, cycles = 0; }
};

double ms(std::int64_t ns) {
  return 1e-6 * static_cast<double>(ns);
}

/// Sets SCHED_FIFO on the hub's processor for the calling thread, if it is permitted.
bool real_time(int priority) {
  ::prctl(PR_SET_TIMERSLACK, 1UL);
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  CPU_SET(kCpu, &cpus);
  const sched_param parameters{.sched_priority = priority};
  return ::pthread_setaffinity_np(::pthread_self(), sizeof cpus, &cpus) == 0 &&
         ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters) == 0;
}

/// The times at which no thread could run on the hub's processor. look() and taken_away() run on
/// this processor, look() with a higher priority than the hub, which calls taken_away(): so after
/// an interruption look() records it before the hub reads it.
class Interruptions {
 public:
  void look(const std::atomic<bool>& stop) {
    (void)real_time(kHighestPriority);
    for (auto due = Clock::now() + kLook; !stop; due = std::max(due + kLook, Clock::now())) {
      std::this_thread::sleep_until(due);
      const auto now = Clock::now();
      if (now - due < kLook) continue;
      const std::size_t next = count_;
      last_[next % last_.size()] = {due, now};
      count_ = next + 1;
      longest_ns_ = std::max(longest_ns_.load(), nanoseconds{now - due}.count());
    }
  }
  [[nodiscard]] nanoseconds taken_away(Clock::time_point begin, Clock::time_point end) const {
    nanoseconds sum{0};
    const std::size_t count = count_;
    for (std::size_t i = count - std::min(count, last_.size()); i < count; ++i) {
      const auto& [from, to] = last_[i % last_.size()];
      sum += std::max(nanoseconds{0}, nanoseconds{std::min(to, end) - std::max(from, begin)});
    }
    return sum;
  }
  [[nodiscard]] std::int64_t longest_ns() const { return longest_ns_; }
  void reset() { longest_ns_ = 0; }

 private:
  struct Interruption {
    Clock::time_point from, to;
  };
  std::array<Interruption, 64> last_;
  std::atomic<std::size_t> count_{0};
  std::atomic<std::int64_t> longest_ns_{0};
};

template <class Cycle>
void run_periodically(const std::atomic<bool>& stop, Longest& longest,
                      const Interruptions& interruptions, Cycle&& cycle) {
  (void)real_time(kPriority);
  for (auto next = Clock::now(); !stop;) {
    const auto begin = Clock::now();
    const auto cpu = cpu_ns();
    cycle(begin);
    const auto end = Clock::now();
    longest.take(nanoseconds{end - begin}.count(),
                 nanoseconds{end - begin - interruptions.taken_away(begin, end)}.count(),
                 cpu_ns() - cpu);
    next = std::max(next + kPeriod, Clock::now());
    std::this_thread::sleep_until(next);
  }
}

/// A path of rows along X with a distance of 25 mm, in layers, with 0.6 mm from vertex to vertex.
/// The coordinates have more digits than necessary, so that the request has the maximum length.
/// The last legs are long: without them the path would determine nothing and be refused.
std::vector<std::array<double, 3>> long_path() {
  constexpr std::size_t kInRow = 668, kRows = 17;
  constexpr double kStep_m = 0.6e-3, kRow_m = 25e-3, kLayer_m = 30e-3, kDigit_m = 1e-8;
  std::mt19937 random{14};
  std::uniform_int_distribution<int> digits(0, 99);

  const auto rounded = [&](double p_m) {
    return kDigit_m * (std::round(p_m / kDigit_m) + digits(random));
  };

  const auto base = calib::otf::base_path({*calib::equidistant_nodes(-0.3, 0.3),
                                           *calib::equidistant_nodes(-0.25, 0.25),
                                           *calib::equidistant_nodes(-0.4, -0.1)});
  const std::size_t in_rows = kVertices - base.vertices_m.size();
  std::vector<std::array<double, 3>> path;
  for (std::size_t row = 0; path.size() < in_rows; ++row) {
    for (std::size_t i = 0; i < kInRow && path.size() < in_rows; ++i) {
      const std::size_t along = row % 2 == 0 ? i : kInRow - 1 - i;
      const std::size_t layer = row / kRows,
                        beside = layer % 2 == 0 ? row % kRows : kRows - 1 - row % kRows;
      path.push_back({rounded(-0.2 + kStep_m * static_cast<double>(along)),
                      rounded(-0.2 + kRow_m * static_cast<double>(beside)),
                      rounded(-0.38 + kLayer_m * static_cast<double>(layer))});
    }
  }
  for (const auto& q : base.vertices_m) path.push_back({q.x(), q.y(), q.z()});

  return path;
}

/// The largest model that can be published: its number of parameters is linear in the number of
/// nodes per axis.
calib::VolumetricModel largest_model(unsigned seed) {
  static const std::size_t finer = [] {
    const auto parameters = [](double f) {
      return daemon::test::synthetic_model(1, f).parameters().size();
    };
    return 1 + (kMostParameters - parameters(1.0)) / (parameters(2.0) - parameters(1.0));
  }();
  return daemon::test::synthetic_model(seed, static_cast<double>(finer));
}

/// The machine stands at the first vertex for a second, passes three vertices per millisecond, and
/// stands at the last. Encoders at 1 kHz.
class DrivenMachine final : public daemon::SampleSource {
 public:
  DrivenMachine(const drivers::TimeSource& time, std::vector<std::array<double, 3>> path)
      : time_(time), path_(std::move(path)) {}

  void drain(daemon::Batch& batch) override {
    const auto now = time_.now();
    if (next_ == HostTime{}) next_ = now;
    for (; next_ <= now; next_ += 1ms) {
      const auto at = place();
      auto& axes = batch.axes.emplace_back();
      axes.head.time = next_;
      axes.axis_count = 3;
      std::copy(at.begin(), at.end(), axes.position.begin());
      protocol::TrackerPoint point;
      point.head.time = next_;
      point.device_time = protocol::DeviceTime{next_.time_since_epoch()};
      point.p_tracker_m = {2.0 + at[0], at[1], at[2]};
      burst_.push_back(point);
      batch.raw.emplace_back().block.length = 32;
    }

    if (burst_.size() < kBurst) return;
    batch.points.insert(batch.points.end(), burst_.begin(), burst_.end());
    burst_.clear();
  }
  [[nodiscard]] std::vector<daemon::StreamHealth> health(HostTime) override {
    std::vector<daemon::StreamHealth> all(8);
    for (auto& h : all) h.status = board_.read("encoder", 0, 0);
    return all;
  }
  void drive() { driving_ = true; }

 private:
  std::array<double, 3> place() {
    constexpr std::size_t kStands = 1000, kVerticesInStep = 3;
    if (driving_) ++driven_;
    const std::size_t way = driven_ < kStands ? 0 : kVerticesInStep * (driven_ - kStands);
    return path_[std::min(way, path_.size() - 1)];
  }

  const drivers::TimeSource& time_;
  std::vector<std::array<double, 3>> path_;
  drivers::StatusBoard board_;
  HostTime next_{};
  std::vector<protocol::TrackerPoint> burst_;
  std::atomic<bool> driving_{false};
  std::size_t driven_ = 0;
};

/// Takes the place of abbe-dds: reads and discards everything that the hub writes to the socket.
void swallow(const std::filesystem::path& socket) {
  const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  socket.string().copy(address.sun_path, sizeof(address.sun_path) - 1);
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) return;
  std::vector<char> buffer(1 << 16);
  while (::recv(fd, buffer.data(), buffer.size(), 0) > 0) {
  }
  ::close(fd);
}

daemon::Config configuration() {
  auto config = daemon::parse_config(
      to_toml(config_tables::mill()) + to_toml(config_tables::Tracker{.port = 1}) +
          to_toml(config_tables::Encoder{}) + std::string{config_tables::kDaemonInItsFolder},
      "abbed.toml");
  if (!config)
    throw std::runtime_error(config.error().text + ": " +
                             fmt::format("{}", fmt::join(config.error().details, "; ")));
  return std::move(*config);
}

class Bench {
 public:
  explicit Bench(bool brief) : seconds_(brief ? 1 : 5) {
    std::string name = std::filesystem::temp_directory_path() / "abbe-hub-cycle-XXXXXX";
    folder_ = ::mkdtemp(name.data());
    daemon::prepare_background_tasks();
    daemon::RecorderThreadOptions options;
    options.recorder.directory = folder_;
    options.recorder.name = "run";
    options.devices.all = {"encoder"};
    recorder_ =
        daemon::RecorderThread::start(std::move(options), {"mill", {}, 1.0, "", {}}).value();
    authority_.emplace(open_models());
    calibration_.emplace(config_, *authority_, recorder_.get());
    publisher_.emplace(
        daemon::DdsLink::listen(folder_ / "dds.sock").value(),
        daemon::PublisherOptions{.machine = "mill", .snapshot_hz = 0.0, .compensation_hz = 0.0},
        protocol::UtcOffset{});
    (void)largest_model(1);  // before the measurement starts
    hub_.emplace(daemon::HubParts{.config = config_,
                                  .time = time_,
                                  .devices = machine_,
                                  .authority = *authority_,
                                  .calibration = *calibration_,
                                  .publisher = &*publisher_,
                                  .recorder = recorder_.get()});
    dds_ = std::thread{[this] { swallow(folder_ / "dds.sock"); }};
    hub_thread_ = std::thread{[this] {
      drivers::prepare_heap_of_this_thread();
      run_periodically(stop_, longest_, interruptions_, [this](auto wall) { hub_->cycle(wall); });
    }};
    control_ =
        daemon::ControlServer::open(folder_ / "control.sock", [this](
                                                                  const json& request,
                                                                  const daemon::ControlPeer& peer) {
          return daemon::answer_request(*hub_, request, peer, 60s);
        }).value();
    interruptions_thread_ = std::thread{[this] { interruptions_.look(stop_); }};
  }
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;
  ~Bench() {
    control_.reset();
    stop_ = true;
    hub_thread_.join();
    interruptions_thread_.join();
    publisher_.reset();
    dds_.join();
    hub_.reset();
    calibration_.reset();
    recorder_.reset();
    std::filesystem::remove_all(folder_);
  }

  /// Runs `what`, then prints the longest cycles since the last call.
  template <class What>
  void measure(std::string_view name, What&& what) {
    longest_.reset();
    interruptions_.reset();
    what();
    fmt::print(
        "{:<24} cycles {:>6}, longest {:7.3f} ms, {:7.3f} ms in wall time, {:7.3f} ms of the "
        "processor; "
        "taken away at most {:7.3f} ms\n",
        name, longest_.cycles.load(), ms(longest_.cycle_ns), ms(longest_.wall_ns),
        ms(longest_.cpu_ns), ms(interruptions_.longest_ns()));
    std::fflush(stdout);
    worst_ns_ = std::max(worst_ns_, longest_.cycle_ns.load());
    worst_wall_ns_ = std::max(worst_wall_ns_, longest_.wall_ns.load());
    worst_interruption_ns_ = std::max(worst_interruption_ns_, interruptions_.longest_ns());
  }

  void stream() const { std::this_thread::sleep_for(seconds_ * 1s); }
  /// Activates models in the model store as `abbe model activate` in another process does; the hub
  /// notices the change of the store.
  void activate_models() {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      auto document = daemon::test::synthetic_document(seed);
      document.model = largest_model(seed);
      document.machine_hash = daemon::machine_hash(config_);
      const auto grid = calib::interpolation_grid(document.model, kMostGridNodes);
      nodes_ = grid.axes_m[0].size() * grid.axes_m[1].size() * grid.axes_m[2].size();
      parameters_ = document.model.parameters().size();
      const daemon::StoreActor actor{"bench", "", protocol::UtcTime{seed * 1s}};
      auto kept = authority_keeper_->keep(document, {.accepted = true}, actor, time_.now());
      if (!kept) throw std::runtime_error(kept.error().text);
      if (is_active(kept->id)) ++active_;
    }
  }
  [[nodiscard]] bool is_active(const std::string& id) {
    json model;
    for (const auto end = Clock::now() + 20s; Clock::now() < end;
         std::this_thread::sleep_for(100ms)) {
      model = ask({{"do", "status"}})["model"];
      if (model["state"] == "ACTIVE" && model.value("id", "") == id) return true;
    }
    fmt::print("model {} did not come into force: {}\n", id, model.dump());
    return false;
  }
  void ask_for_the_path() {
    const json request{{"do", "calibrate"}, {"method", "otf"}, {"path_m", path_}};
    request_bytes_ = request.dump().size();
    (void)ask(request);
  }
  /// Drives the whole path; returns when the identification of the run has started.
  void drive() {
    machine_.drive();
    json session;
    for (const auto end = Clock::now() + 60s; Clock::now() < end;
         std::this_thread::sleep_for(200ms)) {
      session = ask({{"do", "status"}})["session"];
      if (session["state"] == "acquiring") points_ = session["points"];
      if (session["state"] != "acquiring" && session["state"] != "warming") break;
    }
    // or has ended already.
    if (session["state"] == "acquiring" || session["state"] == "warming")
      throw std::runtime_error(session.dump());
  }
  void ask_for_status() {
    for (const auto end = Clock::now() + seconds_ * 1s; Clock::now() < end;)
      (void)ask({{"do", "status"}});
  }
  /// Cancels the identification; no error if it has already ended.
  void cancel() {
    (void)daemon::ask_daemon(folder_ / "control.sock", {{"do", "cancel"}}, 60s);
    stream();
  }
  [[nodiscard]] bool conclude() const {
    const bool within = worst_ns_ <= nanoseconds{kAsked}.count();
    fmt::print(
        "{} of 3 models of {} parameters and {} grid nodes came into force; path of {} vertices in "
        "{:.2f} "
        "MB, "
        "{} points matched\n",
        active_, parameters_, nodes_, path_.size(), 1e-6 * static_cast<double>(request_bytes_),
        points_);
    tests::print_figure(
        "hub cycle, longest", "2 ms",
        "{:.3f} ms; {:.3f} ms in wall time, the processor was taken away for up to {:.3f} ms",
        ms(worst_ns_), ms(worst_wall_ns_), ms(worst_interruption_ns_));

    return within && active_ == 3;
  }

 private:
  daemon::ModelAuthority open_models() {
    auto authority = daemon::ModelAuthority::open(folder_ / "models", config_, {}, time_.now());
    authority_keeper_.emplace(authority.keeper());
    return authority;
  }
  json ask(const json& request) const {
    auto answer = daemon::ask_daemon(folder_ / "control.sock", request, 60s);
    if (!answer) throw std::runtime_error(answer.error().text);
    return std::move(*answer);
  }

  int seconds_;
  std::filesystem::path folder_;
  daemon::Config config_ = configuration();
  drivers::MonotonicTime time_{1.0};
  const std::vector<std::array<double, 3>> path_ = long_path();
  DrivenMachine machine_{time_, path_};
  std::unique_ptr<daemon::RecorderThread> recorder_;
  std::optional<daemon::ModelKeeper> authority_keeper_;
  std::optional<daemon::ModelAuthority> authority_;
  std::optional<daemon::CalibrationService> calibration_;
  std::optional<daemon::Publisher> publisher_;
  std::optional<Hub> hub_;
  std::unique_ptr<daemon::ControlServer> control_;
  std::atomic<bool> stop_{false};
  Longest longest_;
  Interruptions interruptions_;
  std::thread dds_, hub_thread_, interruptions_thread_;
  std::int64_t worst_ns_ = 0, worst_wall_ns_ = 0, worst_interruption_ns_ = 0;
  std::size_t parameters_ = 0, nodes_ = 0, active_ = 0, request_bytes_ = 0, points_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  const bool brief = argc > 1 && std::string_view{argv[1]} == "--short";
  try {
    drivers::keep_heap();
    for (const auto& refusal : drivers::lock_memory())
      fmt::print("memory is not locked: {}\n", refusal);
    std::thread{[] {
      if (!real_time(kPriority))
        fmt::print("no real-time priority: not allowed; the hub is an ordinary thread\n");
    }}.join();
    Bench bench{brief};
    bench.measure("streaming", [&] { bench.stream(); });
    bench.measure("models into force", [&] { bench.activate_models(); });
    bench.measure("request for 1e5 vertices", [&] { bench.ask_for_the_path(); });
    bench.measure("the whole path driven", [&] { bench.drive(); });
    bench.measure("status again and again", [&] { bench.ask_for_status(); });
    bench.measure("cancelled", [&] { bench.cancel(); });
    return bench.conclude() ? 0 : 1;
  } catch (const std::exception& e) {
    fmt::print(stderr, "hub_cycle: {}\n", e.what());
    return 2;
  }
}
