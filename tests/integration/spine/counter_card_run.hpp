#pragma once
/// The axes come from a counter card instead of CAN encoders: abbe-sim plays it over USB/IP, abbed
/// reads it.

#include <regex>
#include <string>

#include "config_tables.hpp"
#include "program.hpp"
#include "spine.hpp"

namespace abbe::test {

struct CounterCardRun : Spine {
  static std::string wiring(const std::string& more) {
    return to_toml(config_tables::CounterCard{.more = more});
  }
  [[nodiscard]] std::string card_at_its_port() const {
    return wiring(wiring_ + "port = " + std::to_string(port("usbip_port")) + "\n");
  }
  /// The simulator reads the same wiring as the daemon. `more`: further tables of both; PORT_2
  /// stands for the second card's port.
  void start_both(std::string more = {}) {
    const std::string anywhere = std::regex_replace(more, std::regex{"PORT_2"}, "0");
    write("machine.toml", text_of(file("machine.toml")) + wiring(wiring_) + anywhere);
    ASSERT_NO_FATAL_FAILURE(start_simulator());
    ASSERT_NE(port("usbip_port"), 0) << text_of(file("ports"));
    more = std::regex_replace(more, std::regex{"PORT_2"}, std::to_string(port("usbip_port_2")));
    write_card_configuration(card_at_its_port() + more);
    ASSERT_NO_FATAL_FAILURE(start_abbed());
  }
  [[nodiscard]] std::string at_speed(const std::string& text) const {
    return replaced(text, "\nspeed = [0-9]+", "\nspeed = " + speed_);
  }

  std::string wiring_;  ///< further keys of [counter_card], of both
  std::string speed_;   ///< of both; empty: the usual one

  void write_card_configuration(const std::string& card) {
    write_configuration_of(tracker_table() + card);
    if (!speed_.empty()) write("abbed.toml", at_speed(text_of(file("abbed.toml"))));
  }
};

}  // namespace abbe::test
