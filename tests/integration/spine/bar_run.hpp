#pragma once
/// A Multi-Feature Bar touched on a machine: abbe-sim drives, abbed reads scales and probe from the
/// counter card and guides.

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <vector>

#include "config_tables.hpp"
#include "spine.hpp"

namespace abbe::test {

/// The machine of abbe-sim mfb with a bar of 6 holes, 110 mm apart.
inline std::string bar_machine_tables(const std::string& at_its_port = {}) {
  std::string machine =
      "[machine]\nname = \"probed\"\nchain = \"[w b X Y Z t]\"\n"
      "[target]\noffset_mm = [0, 0, -150]\n"
      "[model]\nbasis = \"cubic\"\nnode_spacing_mm = 110\n";
  for (const char axis : {'X', 'Y', 'Z'})
    machine += fmt::format("[axes.{}]\nmin_mm = 0\nmax_mm = 550\n", axis);
  // With the card's own timer the instant of a touch is known from the first touch on.
  return machine + to_toml(config_tables::CounterCard{
                       .scan_rate_hz = 200, .more = "clock_source = \"timer0\"\n" + at_its_port});
}

/// Simulated seconds per second, of machine and daemon. Twice that of the other runs: the card has
/// less than half as many scans.
inline constexpr int kBarSpeed = 2 * ABBE_SPINE_SPEED;

struct BarRun : Spine {
  BarRun() {
    write("machine.toml", bar_machine_tables());
    write("sim.toml",
          fmt::format("[sim]\nmachine = \"machine.toml\"\nseed = 1\nspeed = {}\n", kBarSpeed));
  }

  /// 12 passes of 148 touches.
  void start_bar_simulator(const std::vector<std::string>& more = {}) {
    std::vector<std::string> command{ABBE_SIM_PROGRAM,
                                     "mfb",
                                     "--config",
                                     file("sim.toml"),
                                     "--start-on-signal",
                                     "--ports-file",
                                     file("ports"),
                                     "-o",
                                     file("bar"),
                                     "--holes",
                                     "6",
                                     "--pitch-mm",
                                     "110",
                                     "--waves",
                                     "1",
                                     "--plan",
                                     "12",
                                     "--passes",
                                     "forward"};
    command.insert(command.end(), more.begin(), more.end());
    std::filesystem::remove(file("ports"));  // of the simulator before
    ASSERT_NO_FATAL_FAILURE(start_simulator_as(std::move(command)));
  }

  void write_bar_configuration() const {
    write("abbed.toml", bar_machine_tables(fmt::format("port = {}\n", port("usbip_port"))) +
                            "[probe]\ndelay_us = 5\njitter_us = 1\nmax_speed_mm_s = 25\n" +
                            replaced(daemon_tables("off"), "speed = [0-9]+",
                                     fmt::format("speed = {}", kBarSpeed)));
  }
};

}  // namespace abbe::test
