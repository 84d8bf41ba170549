#pragma once
/// The setup of a simulation from files: the machine description, which the daemon reads too, and
/// the simulator's own [sim] table, in the same file or in another one. In files lengths are in mm,
/// small errors in um and urad; here everything is SI.

#include <cstdint>
#include <optional>
#include <string>

#include "abbe/sim/ball_array.hpp"
#include "abbe/sim/simulation.hpp"
#include "abbe/sim/touching.hpp"
#include "abbe/sim/weak_stiffness.hpp"

namespace CLI {  // NOLINT(readability-identifier-naming): the name of CLI11
class App;
}

namespace abbe::sim {

/// The options of the command line; they override the files.
struct SetupChoices {
  std::string config_file;   ///< file with a [sim] table; may name the machine file
  std::string machine_file;  ///< file with [machine], [axes.*], [target]
  std::string path_file;
  std::string truth_file;
  std::optional<std::uint64_t> seed;
  std::optional<double> speed;
  std::optional<double> feed_mm_per_min;
  std::optional<double> dwell_s;
  std::optional<std::uint16_t> tracker_port;
  std::optional<std::uint16_t> can_port;
  std::optional<std::uint16_t> can_peer_port;
  std::string can_interface;
  std::optional<std::uint16_t> usbip_port;
  bool start_when_streaming = false;
  bool start_at_once = false;
  bool needs_path = true;
};

struct LoadedSetup {
  SimulationSetup simulation;
  TouchingOptions touching;             ///< [sim.evemu]
  WeakStiffnessOptions weak_stiffness;  ///< [sim.evemu]
  ArrayState array;                     ///< [sim.ball_array]
  double speed = 1.0;
};

/// Adds the options --config, --machine, --seed and --truth.
void add_machine_options(CLI::App& app, SetupChoices& choices);

/// Error BadInput with every fault of a file at once, Io for a file that cannot be read.
[[nodiscard]] Result<LoadedSetup> load_setup(const SetupChoices& choices);

}  // namespace abbe::sim
