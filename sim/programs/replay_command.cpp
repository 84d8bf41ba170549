/// abbe-sim replay: a recording back on the wire, for an unmodified daemon.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "abbe/sim/controller_server.hpp"
#include "abbe/sim/recorded_bus.hpp"
#include "abbe/sim/recorded_tracker.hpp"
#include "commands.hpp"
#include "event_loop.hpp"
#include "files.hpp"
#include "ports_file.hpp"

namespace abbe::sim {
namespace {

struct ReplayOptions {
  std::string file;
  std::string ports_file;
  double speed = 1.0;
  std::uint16_t tracker_port = 0;
  EncoderBusOptions bus;
  bool exit_at_end = false;
};

using RecordedTrackerServer = ControllerServer<RecordedTracker>;

struct Replay {
  ReplayTimeline timeline;
  std::optional<RecordedTrackerServer> tracker;
  std::optional<RecordedBus> bus;

  void poll(HostTime now) {
    if (tracker) tracker->poll(now);
    if (bus) bus->poll(now);
  }
  [[nodiscard]] HostTime next_due() const {
    return std::min(tracker ? tracker->next_due() : HostTime::max(), bus ? bus->next_due() : HostTime::max());
  }
  [[nodiscard]] std::vector<pollfd> fds() const {
    std::vector<pollfd> all;
    if (tracker) {
      all.push_back({tracker->listener_fd(), POLLIN, 0});
      const short events = static_cast<short>(tracker->wants_write() ? POLLIN | POLLOUT : POLLIN);
      if (tracker->client_fd() >= 0) all.push_back({tracker->client_fd(), events, 0});
    }
    if (bus) all.push_back({bus->fd(), POLLIN, 0});
    return all;
  }
  [[nodiscard]] bool finished() const {
    const bool tracker_done = !tracker || (tracker->device().finished() && !tracker->wants_write());
    return tracker_done && (!bus || bus->finished());
  }
};

const RecordedDevice* first_of(const std::vector<RecordedDevice>& devices, RecordedKind kind) {
  for (const RecordedDevice& device : devices) {
    if (device.kind == kind) return &device;
  }
  return nullptr;
}

Result<std::unique_ptr<Replay>> open(const ReplayOptions& options) {
  const auto text = read_file(options.file);
  if (!text) return tl::unexpected(text.error());
  const auto devices = read_traffic(std::as_bytes(std::span(*text)), options.file);
  if (!devices) return tl::unexpected(devices.error());
  auto replay = std::make_unique<Replay>();
  const RecordedDevice* tracker = first_of(*devices, RecordedKind::Tracker);
  if (tracker != nullptr) {
    auto server = RecordedTrackerServer::open(options.tracker_port,
                                              std::make_unique<RecordedTracker>(*tracker, replay->timeline));
    if (!server) return tl::unexpected(server.error());
    fmt::print(stderr, "replay: {}: {} packets after the start of measuring\n", tracker->name,
               server->device().packets());
    replay->tracker.emplace(std::move(*server));
  }
  if (const RecordedDevice* encoders = first_of(*devices, RecordedKind::Encoders)) {
    auto bus = RecordedBus::open(options.bus, *encoders, replay->timeline, tracker == nullptr);
    if (!bus) return tl::unexpected(bus.error());
    fmt::print(stderr, "replay: {}: {} cycles\n", encoders->name, bus->syncs());
    replay->bus.emplace(std::move(*bus));
  }
  return replay;
}

int replay(const ReplayOptions& options) {
  const EventLoop loop(options.speed);
  const auto opened = open(options);
  if (!opened) return report(opened.error());
  Replay& replay = **opened;
  Ports ports;
  if (replay.tracker) ports.tracker = replay.tracker->port();
  ports.can_interface = replay.bus ? options.bus.interface : "";
  if (replay.bus && ports.can_interface.empty()) ports.can = replay.bus->port();
  if (const auto announced = announce_ports(ports, options.ports_file); !announced)
    return report(announced.error());
  bool was_finished = false;
  while (!loop.stopped() && !(options.exit_at_end && was_finished)) {
    std::vector<pollfd> fds = replay.fds();
    loop.wait(fds, replay.next_due());
    replay.poll(loop.clock().now());
    if (replay.finished() && !was_finished) fmt::print(stderr, "replay: everything served\n");
    was_finished = replay.finished();
  }
  return kDone;
}

}  // namespace

Subcommand add_replay(CLI::App& app) {
  auto options = std::make_shared<ReplayOptions>();  // lives as long as the command line's callbacks
  CLI::App* sub =
      app.add_subcommand("replay", "the raw bytes of a recording on the wire again, with their timing");
  sub->add_option("file", options->file, "MCAP recording with raw bytes")->required()->type_name("FILE");
  sub->add_option("--speed", options->speed,
                  "simulated seconds per second; the daemon must be given the same")
      ->check(CLI::Range(1e-3, 1e4));
  sub->add_option("--tracker-port", options->tracker_port, "TCP; 0 = any free one");
  sub->add_option("--can-port", options->bus.port, "UDP; 0 = any free one");
  sub->add_option("--can-peer-port", options->bus.peer_port,
                  "UDP port of the daemon; 0 = whoever speaks first");
  sub->add_option("--can-interface", options->bus.interface, "SocketCAN interface instead of UDP");
  sub->add_option("--ports-file", options->ports_file, "as of run")->type_name("FILE");
  sub->add_flag("--exit-at-end", options->exit_at_end, "leave when everything has been served");
  return {sub, [options] { return replay(*options); }};
}

}  // namespace abbe::sim
