/// abbe-sim replay: sends the raw bytes of a recording again, to an unmodified daemon.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <memory>

#include "abbe/result/try.hpp"
#include "abbe/sections/bounded_toml.hpp"
#include "abbe/sim/replay.hpp"
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
  ReplaySetup setup;
  std::vector<std::string> places;  ///< NAME=PORT or NAME=PATH
  bool exit_at_end = false;
};

/// Reads options such as "air=1502" and "parts=/tmp/parts".
Result<void> read_places(const ReplayOptions& options, ReplaySetup& setup) {
  for (const std::string& place : options.places) {
    const auto equals = place.find('=');
    const std::string name = place.substr(0, equals);
    const std::string where = equals == std::string::npos ? "" : place.substr(equals + 1);
    if (name.empty() || where.empty())
      return usage_error(fmt::format("--at {}: must be NAME=PORT or NAME=PATH", place));
    std::uint16_t port = 0;
    const auto [end, wrong] = std::from_chars(where.data(), where.data() + where.size(), port);
    if (wrong == std::errc{} && end == where.data() + where.size()) {
      setup.ports[name] = port;
    } else {
      setup.links[name] = where;
    }
  }

  return {};
}

/// Reads, from the recorded configuration, the serial numbers that the daemon expected of its
/// cards.
void read_serials(const std::string& configuration, std::map<std::string, std::string>& serials) {
  const auto root = sections::parse_bounded(configuration, "recorded configuration");
  // Another version of the daemon may have written a configuration that abbe-sim cannot read. The
  // bytes are replayed nevertheless.
  if (!root) return;
  for (const auto& [table, usual] :
       {std::pair{"counter_card", "counter_card"}, std::pair{"reference", "reference_card"}}) {
    const auto serial = (*root)[table]["serial_number"].value<std::string>();
    const auto name = (*root)[table]["name"].value<std::string>();
    if (serial) serials[name.value_or(usual)] = *serial;
  }
}

LineOutput recorded_output(toml::node_view<const toml::node> table) {
  LineOutput output;
  const auto transport = table["transport"].value_or(std::string{});
  if (transport == "tcp-server") output.transport = LineTransport::TcpServer;
  if (transport == "udp") output.transport = LineTransport::Udp;
  if (transport == "serial") output.transport = LineTransport::Serial;
  constexpr std::int64_t kMostPorts = 65535;
  const auto port = table["port"].value_or(std::int64_t{0});
  if (port > 0 && port <= kMostPorts && output.transport != LineTransport::Tcp)
    output.port = static_cast<std::uint16_t>(port);
  return output;
}

/// Reads from the recorded configuration how the lines of a device came. Returns the name of the
/// device that sends axis positions; empty: none.
std::string read_transports(const std::string& configuration,
                            std::map<std::string, LineOutput>& lines) {
  const auto root = sections::parse_bounded(configuration, "recorded configuration");
  if (!root) return {};
  const toml::node_view<const toml::node> tracker{(*root)["tracker"]};
  if (tracker["protocol"].value_or(std::string{}) == "lines")
    lines[tracker["name"].value_or(std::string{"tracker"})] = recorded_output(tracker);

  const toml::node_view<const toml::node> axes{(*root)["axis_lines"]};
  if (!axes.is_table()) return {};
  auto name = axes["name"].value_or(std::string{"axis_lines"});
  lines[name] = recorded_output(axes);
  return name;
}

/// `axes`: the name of the device that sends axis positions as lines.
Ports ports_of(const std::vector<ReplayedPlace>& places, const std::string& axes) {
  Ports ports;
  for (const ReplayedPlace& place : places) {
    fmt::print(stderr, "replay: {}: {}\n", place.name, place.what);
    switch (place.kind) {
      case RecordedKind::Tracker:
        ports.tracker = place.port;
        break;
      case RecordedKind::Encoders:
        ports.can_interface = place.path;
        if (place.path.empty()) ports.can = place.port;
        break;
      case RecordedKind::CounterCard:
        ports.usbip.push_back(place.port);
        break;
      case RecordedKind::ModbusTcp:
        ports.environment.push_back(
            {place.name, fmt::format("Modbus TCP on 127.0.0.1:{}", place.port), place.port, {}});
        break;
      case RecordedKind::ModbusRtu:
        ports.environment.push_back({place.name, "Modbus RTU on " + place.path, 0, place.path});
        break;
      case RecordedKind::MeasuringMachine:
        ports.cmm = place.port;
        break;
      case RecordedKind::Lines:
        (place.name == axes ? ports.line_axes : ports.line_tracker) = place.what;
        if (place.port != 0) (place.name == axes ? ports.axis_lines : ports.tracker) = place.port;
        break;
    }
  }

  return ports;
}

struct OpenReplay {
  std::unique_ptr<Replay> replay;
  std::string axes;  ///< as in ports_of()
};

Result<OpenReplay> open(const ReplayOptions& options, HostTime now) {
  const auto text = read_file(options.file);
  ABBE_TRY(text);
  const auto bytes = std::as_bytes(std::span(*text));
  const auto devices = read_traffic(bytes, options.file);
  ABBE_TRY(devices);
  ReplaySetup setup = options.setup;
  setup.bus.speed = options.speed;
  ABBE_TRY(read_places(options, setup));
  read_serials(recorded_configuration(bytes), setup.serials);
  OpenReplay opened{.replay = nullptr,
                    .axes = read_transports(recorded_configuration(bytes), setup.lines)};
  setup.axes = opened.axes;
  auto replay = Replay::open(*devices, setup, now);
  ABBE_TRY(replay);
  opened.replay = std::move(*replay);
  return opened;
}

int replay(const ReplayOptions& options) {
  const EventLoop loop(options.speed);
  const auto opened = open(options, loop.clock().now());
  if (!opened) return report(opened.error());
  Replay& replay = *opened->replay;
  if (const auto announced =
          announce_ports(ports_of(replay.places(), opened->axes), options.ports_file);
      !announced)
    return report(announced.error());
  bool was_finished = false;

  while (!loop.stopped() && !(options.exit_at_end && was_finished)) {
    std::vector<pollfd> fds;
    replay.add_poll_fds(fds);
    loop.wait(fds, replay.next_due());
    replay.poll(loop.clock().now());
    if (replay.finished() && !was_finished) fmt::print(stderr, "replay: everything served\n");
    was_finished = replay.finished();
  }

  return kDone;
}

}  // namespace

Subcommand add_replay(CLI::App& app) {
  // `options` lives as long as the callbacks of the command line, which share it
  auto options = std::make_shared<ReplayOptions>();
  CLI::App* sub = app.add_subcommand(
      "replay", "send the raw bytes of a recording again, with their original timing");
  sub->add_option("file", options->file, "MCAP recording with raw bytes")
      ->required()
      ->type_name("FILE");
  sub->add_option("--speed", options->speed,
                  "simulated seconds per second; the daemon must be given the same")
      ->check(CLI::Range(1e-3, 1e4));
  sub->add_option("--tracker-port", options->setup.tracker_port, "TCP; 0 = any free one");
  sub->add_option("--can-port", options->setup.bus.port, "UDP; 0 = any free one");
  sub->add_option("--can-peer-port", options->setup.bus.peer_port,
                  "UDP port of the daemon; 0 = the sender of the latest datagram");
  sub->add_option("--can-interface", options->setup.bus.interface,
                  "SocketCAN interface instead of UDP");
  sub->add_option(
         "--at", options->places,
         "NAME=PORT or, for a serial line, NAME=PATH: where the device of that name is served "
         "(default: any free port; repeatable)")
      ->type_name("PLACE");
  sub->add_option("--ports-file", options->ports_file,
                  "written when all ports listen: lines as of abbe-sim run")
      ->type_name("FILE");
  sub->add_flag("--exit-at-end", options->exit_at_end,
                "exit when the whole recording has been sent");

  return {sub, [options] { return replay(*options); }};
}

}  // namespace abbe::sim
