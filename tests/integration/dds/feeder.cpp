// Stands for abbed: publishes the sample messages over a DdsLink until it is killed, and supervises abbe-dds
// as abbed does.   dds_feeder SOCKET [ABBE_DDS ARGUMENT...] Prints "child PID" whenever abbe-dds was started.
#include <cstdio>
#include <optional>
#include <thread>

#include "abbe/daemon/dds_link.hpp"
#include "abbe/daemon/dds_supervisor.hpp"
#include "sample_messages.hpp"

namespace {

using namespace abbe;
using daemon::DdsLink;
using daemon::DdsSupervisor;
using daemon::Topic;

class Feeder {
 public:
  explicit Feeder(DdsLink link) : link_(std::move(link)) {
    send(Topic::ErrorModel, test::error_model());
    for (const auto& slice : test::grid_slices()) send(Topic::ErrorGrid, slice);
  }

  void turn(DdsLink::WallTime now) {
    link_.poll();
    link_.beat(now);
    if (now >= next_state_) {
      send(Topic::ModelState, test::active_state(++sequence_));
      next_state_ = now + std::chrono::seconds{1};
    }
    send(Topic::Snapshot, test::snapshot(++sequence_));
    send(Topic::Compensation, test::compensation(++sequence_));
  }

 private:
  template <class T>
  void send(Topic topic, const T& message) {
    if (daemon::encode(message, payload_)) link_.publish(topic, payload_);
  }

  DdsLink link_;
  std::vector<std::byte> payload_;
  std::uint64_t sequence_ = 0;
  DdsLink::WallTime next_state_{};
};

std::optional<DdsSupervisor> supervisor_for(int argc, char** argv) {
  if (argc < 3) return std::nullopt;
  auto started = DdsSupervisor::start({.program = argv[2], .arguments = {argv + 3, argv + argc}},
                                      std::chrono::steady_clock::now());
  if (!started) std::fprintf(stderr, "%s\n", started.error().text.c_str());
  if (!started) return std::nullopt;
  return std::move(*started);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  auto link = DdsLink::listen(argv[1]);
  if (!link) {
    std::fprintf(stderr, "%s\n", link.error().text.c_str());
    return 4;
  }
  Feeder feeder(std::move(*link));
  auto supervisor = supervisor_for(argc, argv);
  pid_t announced = 0;
  for (;;) {
    const auto now = std::chrono::steady_clock::now();
    feeder.turn(now);
    if (supervisor) supervisor->poll(now);
    if (supervisor && supervisor->pid() != announced) {
      announced = supervisor->pid();
      std::printf("child %d\n", announced);
      std::fflush(stdout);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds{10});
  }
}
