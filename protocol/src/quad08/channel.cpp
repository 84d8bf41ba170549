#include "abbe/protocol/quad08/channel.hpp"

namespace abbe::protocol::quad08 {
namespace {

constexpr std::uint16_t kModeBits = 0x0007;
constexpr std::uint16_t kX2 = 0x0008;
constexpr std::uint16_t kX4 = 0x0010;
constexpr std::uint16_t kLatchOnIndex = 0x0040;
constexpr std::uint16_t kAlways = 0x0800;
constexpr std::uint16_t kRegisterReading = 0x2000;

constexpr std::uint8_t kTimeBits = 0x0F;
constexpr std::uint8_t kDebounceOn = 0x10;
constexpr std::uint8_t kFalling = 0x20;
constexpr std::uint8_t kBeforeStable = 0x40;
constexpr std::uint8_t kChannelOn = 0x80;
constexpr std::uint16_t kIndexAlways = 0x8000;

constexpr std::uint16_t kModulusHigh = 0x30;
constexpr std::uint16_t kModulusMiddle = 0x20;
constexpr std::uint16_t kModulusLow = 0x10;
constexpr std::uint16_t kWholeRange = 0xFFFF;

std::uint16_t quadrature_bits(Quadrature quadrature) ABBE_RT {
  switch (quadrature) {
    case Quadrature::X1:
      return 0;
    case Quadrature::X2:
      return kX2;
    case Quadrature::X4:
      return kX4;
  }
  return 0;
}

}  // namespace

std::uint16_t encode(const CounterSetup& setup) ABBE_RT {
  unsigned word = kAlways | static_cast<unsigned>(setup.mode);
  if (setup.mode == CounterMode::Encoder) word |= quadrature_bits(setup.quadrature);
  if (setup.latch_on_index) word |= kLatchOnIndex;
  if (setup.register_reading) word |= kRegisterReading;
  return static_cast<std::uint16_t>(word);
}

std::optional<CounterSetup> decode_counter_setup(std::uint16_t word) ABBE_RT {
  const unsigned mode = word & kModeBits;
  if (mode < static_cast<unsigned>(CounterMode::Count) ||
      mode > static_cast<unsigned>(CounterMode::Encoder)) {
    return std::nullopt;
  }

  CounterSetup setup;
  setup.mode = static_cast<CounterMode>(mode);
  if (setup.mode == CounterMode::Encoder) {
    setup.quadrature = (word & kX4) != 0   ? Quadrature::X4
                       : (word & kX2) != 0 ? Quadrature::X2
                                           : Quadrature::X1;
  }

  setup.latch_on_index = (word & kLatchOnIndex) != 0;
  setup.register_reading = (word & kRegisterReading) != 0;
  return setup;
}

std::uint8_t encode(const Debounce& debounce) ABBE_RT {
  unsigned code = kChannelOn;
  if (debounce.falling) code |= kFalling;
  if (debounce.enabled) {
    code |= kDebounceOn | (debounce.time_code & kTimeBits);
    if (debounce.trigger_before_stable) code |= kBeforeStable;
  }
  return static_cast<std::uint8_t>(code);
}

std::array<usb::Setup, kChannelWrites> channel_writes(std::uint8_t channel,
                                                      const CounterSetup& setup,
                                                      const Debounce& phases,
                                                      const Debounce& index) ABBE_RT {
  const unsigned phase = encode(phases);
  const auto both_phases = static_cast<std::uint16_t>(phase | phase << 8);
  const auto index_word = static_cast<std::uint16_t>(encode(index) | kIndexAlways);
  const auto bank = [channel](std::uint16_t base) ABBE_RT {
    return write(Register::CounterBank, static_cast<std::uint16_t>(base + channel));
  };
  return {bank(0),
          write(Register::DebouncePhases, both_phases),
          bank(0),
          write(Register::DebounceIndex, index_word),
          bank(0),
          write(Register::CounterSetup, encode(setup)),
          bank(kModulusHigh),
          write(Register::CounterSetup, kWholeRange),
          bank(kModulusMiddle),
          write(Register::CounterSetup, kWholeRange),
          bank(kModulusLow),
          write(Register::CounterSetup, kWholeRange)};
}

}  // namespace abbe::protocol::quad08
