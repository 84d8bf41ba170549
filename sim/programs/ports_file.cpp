#include "ports_file.hpp"

#include <fmt/format.h>

#include <cstdio>

#include "abbe/result/try.hpp"
#include "files.hpp"

namespace abbe::sim {

Ports ports_of(Simulation& simulation, const std::string& can_interface) {
  Ports ports;
  if (simulation.tracker()) ports.tracker = simulation.tracker()->port();
  if (simulation.line_tracker()) {
    ports.line_tracker = simulation.line_tracker()->where();
    if (const auto port = simulation.line_tracker()->port(); port != 0) ports.tracker = port;
  }
  if (simulation.line_axes()) {
    ports.line_axes = simulation.line_axes()->where();
    if (const auto port = simulation.line_axes()->port(); port != 0) ports.axis_lines = port;
  }
  if (simulation.control()) ports.control = simulation.control()->port();
  ports.can_interface = can_interface;
  if (simulation.bus() && can_interface.empty()) ports.can = simulation.bus()->port();
  for (const ModbusServer& server : simulation.environment())
    ports.environment.push_back({server.name(), server.where(), server.port(), server.path()});
  if (simulation.measuring_machine()) ports.cmm = simulation.measuring_machine()->port();
  for (const UsbipServer& card : simulation.counter_cards()) ports.usbip.push_back(card.port());
  return ports;
}

Result<void> announce_ports(const Ports& ports, const std::string& path) {
  std::string lines;
  if (ports.tracker) lines += fmt::format("tracker_port={}\n", *ports.tracker);
  if (ports.control) lines += fmt::format("control_port={}\n", *ports.control);
  if (!ports.can_interface.empty()) lines += fmt::format("can_interface={}\n", ports.can_interface);
  if (ports.can) lines += fmt::format("can_port={}\n", *ports.can);

  for (const NamedPlace& place : ports.environment) {
    lines += place.port != 0 ? fmt::format("{}_port={}\n", place.name, place.port)
                             : fmt::format("{}_path=\"{}\"\n", place.name, place.path);
  }

  // The first card has the bare name, further ones are numbered: usbip_port_2.
  for (std::size_t i = 0; i < ports.usbip.size(); ++i)
    lines +=
        fmt::format("usbip_port{}={}\n", i == 0 ? "" : fmt::format("_{}", i + 1), ports.usbip[i]);
  if (ports.cmm) lines += fmt::format("cmm_port={}\n", *ports.cmm);
  if (ports.axis_lines) lines += fmt::format("axis_lines_port={}\n", *ports.axis_lines);

  if (!path.empty()) {
    ABBE_TRY(write_file(path, lines));
  }

  if (!ports.line_tracker.empty())
    fmt::print("tracker: {}\n", ports.line_tracker);
  else if (ports.tracker)
    fmt::print("tracker: emScon on 127.0.0.1:{}\n", *ports.tracker);
  if (!ports.line_axes.empty()) fmt::print("axes: {}\n", ports.line_axes);
  if (ports.control)
    fmt::print("control: position records on 127.0.0.1:{} (UDP)\n", *ports.control);
  if (ports.can) fmt::print("encoders: CAN over UDP on 127.0.0.1:{}\n", *ports.can);
  if (!ports.can_interface.empty()) fmt::print("encoders: CAN on {}\n", ports.can_interface);
  for (const NamedPlace& place : ports.environment) fmt::print("{}: {}\n", place.name, place.where);
  for (const auto port : ports.usbip)
    fmt::print("counter card: USB/IP on 127.0.0.1:{}, bus id 1-1\n", port);
  if (ports.cmm) fmt::print("measuring machine: I++ DME on 127.0.0.1:{}\n", *ports.cmm);
  std::fflush(stdout);

  return {};
}

}  // namespace abbe::sim
