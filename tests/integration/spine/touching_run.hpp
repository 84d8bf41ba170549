#pragma once
/// A ball array touched on the weak-stiffness machine: abbe-sim drives, abbed reads scales and
/// probe from the counter card and guides.

#include <signal.h>

#include <string>
#include <vector>

#include "spine.hpp"

namespace abbe::test {

struct TouchingRun : Spine {
  TouchingRun();

  /// Call before the simulator starts: the array is not at reference temperature, differs from
  /// its file and carries a temperature sensor.
  void warm_the_array();
  /// Few points: six a ball (two more than a sphere needs), five a block. `more`: options of
  /// abbe-sim evemu.
  void start_touching_simulator(const std::vector<std::string>& more = {});
  /// `gate`: lines of [gate]; `dds`: [dds] supervise.
  void write_touching_configuration(const std::string& gate = kAccepting,
                                    const std::string& dds = "off",
                                    const std::string& probe = kProbe) const;
  [[nodiscard]] std::vector<std::string> calibrate_command(const std::string& calibrator) const;
  /// `abbe calibrate evemu` to its end; the machine begins once the session waits for it.
  [[nodiscard]] Outcome calibrate_touching(const std::string& calibrator = "calibrator.toml") const;
  void let_machine_go() const { simulator_->signal(SIGUSR1); }
  [[nodiscard]] nlohmann::json session() const;

  /// This machine has errors of 3.3 mm, and the array's rotation is not referenced.
  static constexpr const char* kAccepting =
      "max_error_mm = 10\nmax_gradient = 0.5\naccept = [\"evemu-shape-only\"]\n";
  static constexpr const char* kProbe =
      "[probe]\ndelay_us = 5\njitter_us = 1\nmax_speed_mm_s = 25\n";

 private:
  bool warm_ = false;
  int usbip_port_ = 0;
  int sensor_port_ = 0;
};

}  // namespace abbe::test
