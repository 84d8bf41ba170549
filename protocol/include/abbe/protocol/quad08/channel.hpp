#pragma once
/// Configuration words of one counter of the card: encoding and decoding. Configuring a counter
/// sets its count to zero. Bits of the setup word: 0-2 mode, 3-9 options of the mode, 11 always
/// set, 13 register (not scan) reading [MCC uldaq, CtrUsbQuad08, MIT].

#include <array>
#include <cstdint>
#include <optional>

#include "abbe/protocol/quad08/registers.hpp"

namespace abbe::protocol::quad08 {

enum class CounterMode : std::uint8_t {
  Count = 1,
  Period = 2,
  PulseWidth = 3,
  Timing = 4,
  Encoder = 5
};
enum class Quadrature : std::uint8_t { X1 = 1, X2 = 2, X4 = 4 };

struct CounterSetup {
  CounterMode mode = CounterMode::Count;
  Quadrature quadrature = Quadrature::X4;  ///< Encoder only
  /// The index input latches the count. ASSUMPTION, to be verified on hardware: a scan then
  /// contains the count at the latest index edge instead of the count at the start of the scan;
  /// before the first edge it contains 0.
  bool latch_on_index = false;
  bool register_reading = false;  ///< true: read by registers; false: read by scans
  friend bool operator==(const CounterSetup&, const CounterSetup&) = default;
};
[[nodiscard]] std::uint16_t encode(const CounterSetup& setup) ABBE_RT;
/// nullopt for an invalid mode.
[[nodiscard]] std::optional<CounterSetup> decode_counter_setup(std::uint16_t word) ABBE_RT;

/// Input filter. Time codes 0 to 15: 500 ns, 1.5, 3.5, 7.5, 15.5, 31.5, 63.5, 127.5 us, 100, 300,
/// 700 us, 1.5, 3.1, 6.3, 12.7, 25.5 ms.
struct Debounce {
  bool enabled = false;
  std::uint8_t time_code = 0;
  bool falling = false;
  /// true: the first edge counts, then further edges are ignored for the time of `time_code`
  bool trigger_before_stable = false;
};
[[nodiscard]] std::uint8_t encode(const Debounce& debounce) ABBE_RT;
inline constexpr std::array<double, 16> kDebounce_s{
    500e-9, 1.5e-6, 3.5e-6, 7.5e-6, 15.5e-6, 31.5e-6, 63.5e-6, 127.5e-6,
    100e-6, 300e-6, 700e-6, 1.5e-3, 3.1e-3,  6.3e-3,  12.7e-3, 25.5e-3};

/// All register writes that configure one counter, in order.
inline constexpr std::size_t kChannelWrites = 12;
[[nodiscard]] std::array<usb::Setup, kChannelWrites> channel_writes(std::uint8_t channel,
                                                                    const CounterSetup& setup,
                                                                    const Debounce& phases,
                                                                    const Debounce& index) ABBE_RT;

}  // namespace abbe::protocol::quad08
