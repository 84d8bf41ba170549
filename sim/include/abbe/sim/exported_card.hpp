#pragma once
/// The interface between a USB/IP server and the counter card that it exports: the simulated card
/// or the replay of a recorded one.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "abbe/protocol/usb/setup.hpp"
#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

struct ControlAnswer {
  enum class Outcome : std::uint8_t { Done, Stalled, Silent };
  Outcome outcome = Outcome::Done;
  std::vector<std::byte> data;
};
struct UsbIds {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
};

class ExportedCard {
 public:
  ExportedCard() = default;
  ExportedCard(const ExportedCard&) = delete;
  ExportedCard& operator=(const ExportedCard&) = delete;
  virtual ~ExportedCard() = default;

  [[nodiscard]] virtual UsbIds ids() const = 0;
  [[nodiscard]] virtual ControlAnswer answer(const protocol::usb::Setup& setup, HostTime now) = 0;
  /// Makes the scans due until `now`; the host has requested `wanted` bytes.
  virtual void advance(HostTime now, std::size_t wanted) = 0;
  /// Removes and returns bytes for the host: at most `most`, oldest first.
  [[nodiscard]] virtual std::vector<std::byte> take(std::size_t most) = 0;
  [[nodiscard]] virtual std::size_t available() const = 0;
  /// Time at which `bytes` bytes will be available; HostTime::max() if no scan runs.
  [[nodiscard]] virtual HostTime available_at(std::size_t bytes) const = 0;
  /// True while the card will make more bytes: a request of the host then waits until it can be
  /// filled.
  [[nodiscard]] virtual bool scanning() const = 0;
  /// Call it when the host's connection has ended.
  virtual void host_disconnected() {}
  /// Time at which the connection breaks although the host did not request it; HostTime::max():
  /// never.
  [[nodiscard]] virtual HostTime breaks_at() const { return HostTime::max(); }
};

}  // namespace abbe::sim
