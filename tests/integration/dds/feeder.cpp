// Replaces abbed: publishes the sample messages over a DdsLink until it is killed, and supervises
// abbe-dds as abbed does.
//   dds_feeder SOCKET MACHINE [ABBE_DDS ARGUMENT...]
// Prints "child PID" at every start of abbe-dds, and "twin TEXT" or "twin none" when abbe-dds
// reports one. The first component of its vectors is the time at
// which they were made: CLOCK_MONOTONIC modulo 1000 s, in units of 1e-6. With ABBE_FEEDER_STALE in
// its environment the state is STALE until SIGUSR1. ABBE_FEEDER_MACHINE_ID: its identity instead of
// one of its own; "none": no Identity is published, as by an earlier version.
#include <signal.h>

#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <thread>

#include "abbe/messages/dds_link.hpp"
#include "abbe/publishing/dds_supervisor.hpp"
#include "sample_messages.hpp"

namespace {

using namespace abbe;
using daemon::DdsLink;
using daemon::DdsSupervisor;
using daemon::Topic;

volatile sig_atomic_t stale = 0;

v1::ModelState state(std::uint64_t sequence) {
  auto state = test::active_state(sequence);
  if (stale != 0) state.state(v1::MODEL_STALE);
  return state;
}

/// Each machine has an identity of its own, that of test::kMachine is test::kMachineId.
v1::Identity identity(std::uint64_t sequence, const std::string& machine) {
  auto identity = test::identity(sequence);
  if (machine != test::kMachine) identity.machine_id(("id-of-" + machine).substr(0, 36));
  if (const char* const id = std::getenv("ABBE_FEEDER_MACHINE_ID")) identity.machine_id(id);
  return identity;
}

class Feeder {
 public:
  Feeder(DdsLink link, std::string machine) : link_(std::move(link)), machine_(std::move(machine)) {
    send(Topic::ErrorModel, test::error_model());
    for (const auto& slice : test::grid_slices()) send(Topic::ErrorGrid, slice);
  }

  void cycle(DdsLink::WallTime now) {
    link_.poll();
    link_.beat(now);
    report_twin();
    if (now >= next_state_) {
      auto which = identity(++sequence_, machine_);
      which.twin(!link_.twin().empty());
      which.twin_seen(link_.twin());
      if (which.machine_id() != "none") send(Topic::Identity, which);
      send(Topic::ModelState, state(++sequence_));
      next_state_ = now + std::chrono::seconds{1};
    }
    send(Topic::Snapshot, test::snapshot(++sequence_), now);
    send(Topic::Compensation, vector(now), now);
  }

 private:
  void report_twin() {
    if (link_.twin() == twin_) return;
    twin_ = link_.twin();
    std::printf("twin %s\n", twin_.empty() ? "none" : twin_.c_str());
    std::fflush(stdout);
    next_state_ = {};
  }
  v1::Compensation vector(DdsLink::WallTime now) {
    auto vector = test::compensation(++sequence_);  // 1 ms old
    const std::int64_t made_ns = now.time_since_epoch().count() - vector.age_ns();
    vector.host_time_ns(made_ns);
    vector.vector_m()[0] = static_cast<double>(made_ns % 1'000'000'000'000) * 1e-9;
    return vector;
  }
  template <class T>
  void send(Topic topic, T message, DdsLink::WallTime at = DdsLink::WallTime::clock::now()) {
    message.machine(machine_);
    if (daemon::encode(message, payload_)) link_.publish(topic, payload_, at);
  }

  DdsLink link_;
  std::string machine_, twin_;
  std::vector<std::byte> payload_;
  std::uint64_t sequence_ = 0;
  DdsLink::WallTime next_state_{};
};

std::optional<DdsSupervisor> supervisor_for(int argc, char** argv) {
  if (argc < 4) return std::nullopt;
  auto started = DdsSupervisor::start({.program = argv[3], .arguments = {argv + 4, argv + argc}},
                                      std::chrono::steady_clock::now());
  if (!started) std::fprintf(stderr, "%s\n", started.error().text.c_str());
  if (!started) return std::nullopt;
  return std::move(*started);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  stale = std::getenv("ABBE_FEEDER_STALE") != nullptr ? 1 : 0;
  ::signal(SIGUSR1, [](int) { stale = 0; });
  auto link = DdsLink::listen(argv[1]);

  if (!link) {
    std::fprintf(stderr, "%s\n", link.error().text.c_str());
    return 4;
  }

  Feeder feeder(std::move(*link), argv[2]);
  auto supervisor = supervisor_for(argc, argv);
  pid_t announced = 0;

  for (;;) {
    const auto now = std::chrono::steady_clock::now();
    feeder.cycle(now);
    if (supervisor) supervisor->poll(now);
    if (supervisor && supervisor->pid() != announced) {
      announced = supervisor->pid();
      std::printf("child %d\n", announced);
      std::fflush(stdout);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds{10});
  }
}
