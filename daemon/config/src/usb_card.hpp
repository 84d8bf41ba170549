#pragma once
/// Readers that the tables of all USB-QUAD08 cards share.

#include <cstdint>
#include <string>
#include <string_view>

#include "abbe/config/config.hpp"
#include "abbe/config/usb_card.hpp"
#include "classified_section.hpp"

namespace abbe::daemon {

inline constexpr auto kLastChannel = static_cast<std::int64_t>(drivers::quad08::kChannels) - 1;

/// Reads transport and address.
void read_card_address(ClassifiedSection& table, UsbCardConfig& out);
void read_card_clock(ClassifiedSection& table, drivers::CounterCardWiring& out);
void read_debounce(ClassifiedSection& table, Key key, drivers::quad08::Debounce& out);

/// Address of the card and the axes that it counts, as text for `abbed --check-config`.
[[nodiscard]] std::string card_text(const UsbCardConfig& card, const MachineConfig& machine);

}  // namespace abbe::daemon
