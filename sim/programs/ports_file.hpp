#pragma once
/// The addresses at which the devices listen. They are printed to standard output, and written to a
/// file for scripts as soon as all devices listen. The lines of the file can be read by a shell and
/// by a TOML reader; a device that does not exist has no line:
///
///   tracker_port=N, control_port=N, can_port=N or can_interface=NAME, usbip_port=N, cmm_port=N,
///   axis_lines_port=N

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "abbe/sim/error.hpp"
#include "abbe/sim/simulation.hpp"

namespace abbe::sim {

/// A device of [[sim.environment]]: `NAME_port=N`, or `NAME_path="PATH"` on a pseudo terminal.
struct NamedPlace {
  std::string name;
  std::string where;       ///< address in messages
  std::uint16_t port = 0;  ///< 0: on a pseudo terminal
  std::string path;
};

struct Ports {
  std::optional<std::uint16_t> tracker;
  std::string line_tracker;  ///< where it prints its lines; empty: it speaks emScon
  std::string line_axes;     ///< where the axes print their lines; empty: nowhere
  std::optional<std::uint16_t> axis_lines;
  std::optional<std::uint16_t> control;  ///< UDP, position records
  std::optional<std::uint16_t> can;
  std::vector<NamedPlace> environment;
  std::vector<std::uint16_t> usbip;  ///< one per counter card
  std::optional<std::uint16_t> cmm;
  std::string can_interface;  ///< SocketCAN; `can` is then empty
};

/// The addresses at which the devices of a simulation listen. The encoders are on `can_interface`
/// if it is not empty.
[[nodiscard]] Ports ports_of(Simulation& simulation, const std::string& can_interface = {});

/// Writes the ports to the file `path` (empty: no file), then prints them.
[[nodiscard]] Result<void> announce_ports(const Ports& ports, const std::string& path);

}  // namespace abbe::sim
