#pragma once
/// Measurement Computing USB-QUAD08: identity and registers. Every access is a vendor request on
/// endpoint 0; a write has no data stage, a read gives two bytes, little-endian
/// [MCC uldaq, UsbIotech, MIT].

#include <cstdint>
#include <optional>
#include <span>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/usb/setup.hpp"

namespace abbe::protocol::quad08 {

inline constexpr std::uint16_t kVendor = 0x09DB;
inline constexpr std::uint16_t kProduct = 0x00CA;
inline constexpr std::uint8_t kScanEndpoint = 0x82;
inline constexpr std::uint16_t kPacketSize = 512;  ///< packet size of the scan endpoint, high speed
inline constexpr std::uint8_t kConfiguration = 1;
inline constexpr std::size_t kChannels = 8;
inline constexpr double kPacerClock_hz = 48e6;
inline constexpr std::uint16_t kOldestFirmware = 0x0100;

enum class Request : std::uint8_t { FirmwareVersion = 0xB0, Register = 0xB4, EndpointReset = 0xBB };

enum class Register : std::uint16_t {
  Acquisition = 0x00,  ///< write: AcqControl; read: status
  ScanList = 0x01,
  PacerDivisorLow = 0x02,
  PacerDivisorMiddle = 0x03,
  PacerDivisorHigh = 0x05,
  SetpointFifo = 0x09,
  ConversionRate = 0x0F,
  DacControl = 0x10,
  CounterSetup = 0x28,  ///< in the selected bank: setup word or modulus word of a counter
  DebouncePhases = 0x2C,
  DebounceIndex = 0x2D,
  CounterBank = 0x2E,
  CounterWord0 = 0x30,  ///< .. 0x33: the selected counter, lowest word first
  TimerControl = 0x40,
  Timer0Divisor = 0x50,
  Timer1Divisor = 0x51,
  DmaControl = 0x58,
  TriggerControl = 0x59,
  Mark = 0x5D,  ///< reads back the value written; used for the self-test
};

/// Values written to Register::Acquisition.
namespace acquisition {
inline constexpr std::uint16_t kEnd = 0x00;
inline constexpr std::uint16_t kResetResults = 0x03;  ///< results FIFO and configuration pipe
inline constexpr std::uint16_t kResetScanList = 0x04;
inline constexpr std::uint16_t kStopScanList = 0x10;
inline constexpr std::uint16_t kStartScanList = 0x11;
inline constexpr std::uint16_t kPacerOff = 0x30;
inline constexpr std::uint16_t kPacerInternal = 0x31;
inline constexpr std::uint16_t kPacerExternal = 0x33;
inline constexpr std::uint16_t kDigitalEnhancedOff = 0x40;
inline constexpr std::uint16_t kResetSetpoints = 0x54;
inline constexpr std::uint16_t kPacerNormal = 0x60;
inline constexpr std::uint16_t kStartSetpoints = 0x71;
}  // namespace acquisition

namespace dma {
inline constexpr std::uint16_t kChannel0Off = 0x00;
inline constexpr std::uint16_t kChannel1Off = 0x10;
inline constexpr std::uint16_t kChannel1On = 0x11;
}  // namespace dma

namespace trigger {
inline constexpr std::uint16_t kAnalogOff = 0x00;
inline constexpr std::uint16_t kTtlOff = 0x10;
}  // namespace trigger

namespace timer {
inline constexpr std::uint16_t kStop0 = 0x00;
inline constexpr std::uint16_t kStart0 = 0x01;
inline constexpr std::uint16_t kStop1 = 0x10;
inline constexpr std::uint16_t kStart1 = 0x11;
}  // namespace timer

/// Value read from Register::Acquisition.
struct Status {
  std::uint16_t bits = 0;
  static constexpr std::uint16_t kMoreSamples = 0x001;
  static constexpr std::uint16_t kValidData = 0x002;
  static constexpr std::uint16_t kFifoOverrun = 0x004;
  static constexpr std::uint16_t kScanning = 0x008;
  static constexpr std::uint16_t kPipeFull = 0x010;
  static constexpr std::uint16_t kScanListEmpty = 0x020;
  static constexpr std::uint16_t kArbitrationFailed = 0x080;
  static constexpr std::uint16_t kPacerOverrun = 0x100;
  static constexpr std::uint16_t kHardwareError = 0x1C0;

  [[nodiscard]] constexpr bool overrun() const noexcept {
    return (bits & (kFifoOverrun | kPacerOverrun)) != 0;
  }
  [[nodiscard]] constexpr bool hardware_error() const noexcept {
    return (bits & kHardwareError) != 0;
  }
  /// True if the scan list is loaded and no scan is in progress: the pacer may be started.
  [[nodiscard]] constexpr bool ready() const noexcept {
    return (bits & (kPipeFull | kScanning)) == kPipeFull;
  }
};

[[nodiscard]] constexpr usb::Setup write(Register where, std::uint16_t value) noexcept {
  return {0x40, static_cast<std::uint8_t>(Request::Register), value,
          static_cast<std::uint16_t>(where), 0};
}
[[nodiscard]] constexpr usb::Setup read(Register where) noexcept {
  return {0xC0, static_cast<std::uint8_t>(Request::Register), 0, static_cast<std::uint16_t>(where),
          2};
}
[[nodiscard]] constexpr usb::Setup read_firmware_version() noexcept {
  return {0xC0, static_cast<std::uint8_t>(Request::FirmwareVersion), 0, 0, 2};
}
[[nodiscard]] constexpr usb::Setup reset_scan_endpoint() noexcept {
  return {0x40, static_cast<std::uint8_t>(Request::EndpointReset), 1, kScanEndpoint & 0x0F, 0};
}
/// True for a write to this register.
[[nodiscard]] constexpr bool is_write(const usb::Setup& setup, Register where) noexcept {
  return setup.request_type == 0x40 &&
         setup.request == static_cast<std::uint8_t>(Request::Register) &&
         setup.index == static_cast<std::uint16_t>(where);
}

/// The word in the answer to a read; nullopt unless the answer has two bytes.
[[nodiscard]] std::optional<std::uint16_t> decode_word(std::span<const std::byte> bytes) ABBE_RT;

}  // namespace abbe::protocol::quad08
