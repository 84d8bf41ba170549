#pragma once
/// Where the devices listen, for people (standard output) and for scripts (a file written when
/// everything listens, whose lines `tracker_port=N`, `can_port=N` or `can_interface=NAME`,
/// `usbip_port=N` and `cmm_port=N` a shell and a TOML reader both understand; a device that is not
/// there has no line).

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
  std::string where;       ///< for people
  std::uint16_t port = 0;  ///< 0: on a pseudo terminal
  std::string path;
};

struct Ports {
  std::optional<std::uint16_t> tracker;
  std::optional<std::uint16_t> can;
  std::vector<NamedPlace> environment;
  std::vector<std::uint16_t> usbip;  ///< one a counter card
  std::optional<std::uint16_t> cmm;
  std::string can_interface;  ///< SocketCAN; no port then
};

/// Where the devices of a simulation listen; encoders on `can_interface` if it has a name.
[[nodiscard]] Ports ports_of(Simulation& simulation, const std::string& can_interface = {});

/// The file is there before anything is printed. Empty path: no file.
[[nodiscard]] Result<void> announce_ports(const Ports& ports, const std::string& path);

}  // namespace abbe::sim
