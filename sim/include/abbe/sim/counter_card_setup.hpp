#pragma once
/// A counter card wired to a virtual machine: the channels of the axes, the clock and the probe.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "abbe/sim/counter_card.hpp"
#include "abbe/sim/measured_axis.hpp"
#include "abbe/sim/virtual_machine.hpp"

namespace abbe::sim {

struct CardAxis {
  /// name of the axis: X, Y, Z follow the path; any other is a rotary axis
  std::string name = "X";
  std::uint8_t channel = 0;
  double step = 10e-9;         ///< m or rad per count; negative: counts fall as the reading rises
  double noise = 0.0;          ///< standard deviation of one reading, m or rad
  RotarySwing swing;           ///< rotary axis: its motion
  double signal_period = 0.0;  ///< signal period of the distance-coded marks, m or rad; 0: no marks
  int nominal_increment = 1000;  ///< signal periods between two fixed marks
  double marks_zero = 0.0;       ///< scale reading of the first fixed mark
  int mark_pairs = 500;
};

struct CounterCardSetup {
  std::uint16_t port = 0;
  std::string serial = "01ABBE08";
  std::vector<CardAxis> axes;
  std::uint8_t clock_channel = 5;
  bool own_timer = false;  ///< the card's timer 0 is wired to the clock inputs
  double clock_hz = 10e6;
  double clock_deviation_ppm = 0.0;
  std::optional<std::uint8_t> latch_channel = 6;
  std::optional<std::uint8_t> edge_channel = 7;
  std::size_t fifo_bytes = std::size_t{256} * 1024;
  std::uint64_t seed = 1;
};

/// `machine` must outlive the card.
[[nodiscard]] CounterCardOptions wire(const CounterCardSetup& setup, const VirtualMachine& machine);

/// Scale readings of distance-coded reference marks, ascending, k = 0 .. pairs - 1: fixed mark k is
/// k `nominal_increment` signal periods after `zero`; its coded mark follows it after
/// `nominal_increment` / 2 + k + 1 signal periods.
[[nodiscard]] std::vector<double> distance_coded_marks(double zero, double signal_period,
                                                       int nominal_increment, int pairs);

}  // namespace abbe::sim
