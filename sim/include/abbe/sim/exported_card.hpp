#pragma once
/// What a USB/IP server needs of the counter card that it exports: the simulated one or the one of
/// a recording.

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
  /// Makes the scans due until `now`; `wanted` bytes of them are asked for.
  virtual void advance(HostTime now, std::size_t wanted) = 0;
  /// Bytes for the host, oldest first; at most `most`.
  [[nodiscard]] virtual std::vector<std::byte> take(std::size_t most) = 0;
  [[nodiscard]] virtual std::size_t available() const = 0;
  /// When there will be so many bytes; never if the scan does not run.
  [[nodiscard]] virtual HostTime available_at(std::size_t bytes) const = 0;
  /// More bytes will come: a request waits until it can be filled.
  [[nodiscard]] virtual bool scanning() const = 0;
  /// The host's connection has ended.
  virtual void host_gone() {}
  /// When the connection breaks by itself.
  [[nodiscard]] virtual HostTime breaks_at() const { return HostTime::max(); }
};

}  // namespace abbe::sim
