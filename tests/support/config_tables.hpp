#pragma once
/// Tables of machine.toml and abbed.toml as the tests of several programs write them: `to_toml()`
/// of each is its text, and texts are concatenated. Keys that only one test needs are text in that
/// test: `more` contains further keys of a table.

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace abbe::config_tables {

struct Travel {
  double min_mm = 0.0;
  double max_mm = 0.0;
  std::optional<double> reference_mm = {};
};

/// [machine], [axes] and, if they have a value, [target] and [model].
struct Machine {
  std::string name = "mill";
  std::string chain = "[w X' b Y Z (C1) t]";
  Travel x = {}, y = {}, z = {};
  std::string_view rotary = {};  ///< a letter for each rotary axis
  std::optional<std::array<double, 3>> target_offset_mm = {};
  std::optional<double> node_spacing_mm = {};
};

/// The machine of most tests.
inline Machine mill() {
  return {.x = {-300, 300},
          .y = {-250, 250},
          .z = {-400, -100},
          .target_offset_mm = {{20, -15, -120}},
          .node_spacing_mm = 50};
}

/// The machine of reference case A (otf_reference.hpp).
inline Machine case_a() {
  return {.name = "case A",
          .x = {-300, 300},
          .y = {-250, 250},
          .z = {-400, 0},
          .target_offset_mm = {{20, -15, -120}},
          .node_spacing_mm = 50};
}

/// Travels of 500 mm.
inline Machine half_metre_mill() {
  return {.x = {0, 500}, .y = {0, 500}, .z = {0, 500}, .target_offset_mm = {{0, 0, 0}}};
}

/// The machine of [Li OMM]: base, Z, X, Y, probe.
inline Machine weak_portal() {
  return {.name = "weak portal",
          .chain = "[w b Z X Y t]",
          .x = {-150, 650},
          .y = {-150, 400},
          .z = {-50, 150},
          .target_offset_mm = {{0, 0, 0}}};
}

/// [tracker] with a simulated tracker.
struct Tracker {
  std::uint16_t port = 0;
  std::string more = {};
};

/// [encoder]: one node per axis on CAN over UDP.
struct Encoder {
  std::uint16_t peer_port = 1;  ///< 1: no node answers on this port
  std::int64_t sync_period_us = 100'000;
  int step_nm = 1;
  std::string_view rotary = {};  ///< a letter for each rotary axis, with 2^20 counts
};

/// [counter_card] of abbe-sim over USB/IP; its counters are zero at the current position of the
/// machine.
struct CounterCard {
  int scan_rate_hz = 1000;
  std::string more = {};
};

/// [dds] limited to this computer.
struct Dds {
  std::string domain;
  std::string profile;
  std::string more = {};
};

/// [daemon] of a simulation, with its folders beside the configuration; further keys may follow.
inline constexpr std::string_view kDaemonInItsFolder = R"([daemon]
data_dir = "data"
runtime_dir = "run"
simulated = true
)";

[[nodiscard]] inline std::string to_toml(std::string_view axis, const Travel& travel) {
  std::string text =
      fmt::format("[axes.{}]\nmin_mm = {}\nmax_mm = {}\n", axis, travel.min_mm, travel.max_mm);
  if (travel.reference_mm) text += fmt::format("reference_mm = {}\n", *travel.reference_mm);
  return text;
}

[[nodiscard]] inline std::string to_toml(const Machine& machine) {
  std::string text =
      fmt::format("[machine]\nname = \"{}\"\nchain = \"{}\"\n", machine.name, machine.chain) +
      to_toml("X", machine.x) + to_toml("Y", machine.y) + to_toml("Z", machine.z);
  for (const char axis : machine.rotary)
    text += fmt::format("[axes.{}]\nkind = \"rotary\"\nmin_rad = -1.5\nmax_rad = 1.5\n", axis);
  if (const auto& t = machine.target_offset_mm)
    text += fmt::format("[target]\noffset_mm = [{}, {}, {}]\n", (*t)[0], (*t)[1], (*t)[2]);
  if (machine.node_spacing_mm)
    text += fmt::format("[model]\nnode_spacing_mm = {}\n", *machine.node_spacing_mm);
  return text;
}

[[nodiscard]] inline std::string to_toml(const Tracker& tracker) {
  return fmt::format("[tracker]\nhost = \"127.0.0.1\"\nport = {}\npoint_rate_hz = 500\n{}",
                     tracker.port, tracker.more);
}

[[nodiscard]] inline std::string to_toml(const Encoder& encoder) {
  std::string rotary;
  for (std::size_t i = 0; i < encoder.rotary.size(); ++i)
    rotary += fmt::format("  {{ axis = \"{}\", node = {}, step_nrad = 5992.1124526782 }},\n",
                          encoder.rotary[i], i + 4);
  return fmt::format(R"([encoder]
transport = "udp"
peer_host = "127.0.0.1"
peer_port = {}
sync_period_us = {}
nodes = [
  {{ axis = "X", node = 1, step_nm = {step_nm} }},
  {{ axis = "Y", node = 2, step_nm = {step_nm} }},
  {{ axis = "Z", node = 3, step_nm = {step_nm} }},
{rotary}]
)",
                     encoder.peer_port, encoder.sync_period_us,
                     fmt::arg("step_nm", encoder.step_nm), fmt::arg("rotary", rotary));
}

[[nodiscard]] inline std::string to_toml(const CounterCard& card) {
  return fmt::format(R"([counter_card]
transport = "usbip"
zero = "here"
serial_number = "01ABBE08"
clock_MHz = 1
scan_rate_hz = {}
latch_channel = 6
{}axes = [
  {{ axis = "X", channel = 0, step_nm = 10 }},
  {{ axis = "Y", channel = 1, step_nm = 10 }},
  {{ axis = "Z", channel = 2, step_nm = 10 }},
]
)",
                     card.scan_rate_hz, card.more);
}

[[nodiscard]] inline std::string to_toml(const Dds& dds) {
  return fmt::format("[dds]\ndomain = {}\nprofile = \"{}\"\n{}", dds.domain, dds.profile, dds.more);
}

}  // namespace abbe::config_tables
