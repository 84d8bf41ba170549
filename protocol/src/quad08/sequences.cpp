#include "abbe/protocol/quad08/sequences.hpp"

namespace abbe::protocol::quad08 {
namespace {

constexpr std::uint16_t kDacPacerOff = 0x10;
constexpr std::uint16_t kDacResetFifo = 0x04;
constexpr int kMarkBits = 8;

/// Disarms the analog outputs. The first pass writes 0 instead of the numbers of the outputs.
void disarm_dac(Sequence& out, bool first_pass) ABBE_RT {
  out.add(Register::DacControl, kDacPacerOff);
  out.add(Register::DmaControl, dma::kChannel0Off);
  for (std::uint16_t output = 0x20; output <= 0x60;
       output = static_cast<std::uint16_t>(output + 0x10))
    out.add(Register::DacControl, first_pass ? std::uint16_t{0} : output);
}

void disarm(Sequence& out) ABBE_RT {
  out.add(Register::TriggerControl, trigger::kAnalogOff);
  out.add(Register::TriggerControl, trigger::kTtlOff);
  out.add(Register::Acquisition, acquisition::kPacerOff);
  out.add(Register::Acquisition, acquisition::kStopScanList);
  out.add(Register::Acquisition, acquisition::kResetResults);
  out.add(Register::DmaControl, dma::kChannel1Off);
}

/// Writes values to the mark register and reads them back: one bit set, a different one each time;
/// every second value is inverted.
void test_registers(Sequence& out) ABBE_RT {
  for (int i = 0; i < kMarkBits; ++i) {
    const unsigned bit = 1u << i;
    const auto pattern = static_cast<std::uint16_t>(((i & 1) != 0 ? bit : ~bit) & 0xFFu);
    out.add(Register::Mark, pattern);
    out.add(Step{read(Register::Mark), Expect::LowByte, pattern});
  }
}

}  // namespace

bool fulfilled(const Step& step, std::uint16_t answer) ABBE_RT {
  switch (step.expect) {
    case Expect::Nothing:
      return true;
    case Expect::LowByte:
      return (answer & 0xFFu) == step.value;
    case Expect::AtLeast:
      return answer >= step.value;
  }
  return false;
}

Sequence open_sequence() ABBE_RT {
  Sequence out;
  // The steps run twice, because the manufacturer's library runs them on loading and on opening.
  for (const bool first_pass : {true, false}) {
    out.add(Step{read_firmware_version(), Expect::AtLeast, kOldestFirmware});
    test_registers(out);
    disarm_dac(out, first_pass);
    out.add(Register::DacControl, kDacResetFifo);
    disarm(out);
  }
  return out;
}

Sequence timer_stop(Timer timer) ABBE_RT {
  Sequence out;
  out.add(Register::TimerControl, timer == Timer::Timer0 ? timer::kStop0 : timer::kStop1);
  return out;
}

Sequence timer_start(Timer timer, std::uint32_t divisor) ABBE_RT {
  Sequence out;
  const auto where = timer == Timer::Timer0 ? Register::Timer0Divisor : Register::Timer1Divisor;
  const std::uint32_t period = divisor - 1;
  const std::uint32_t high = divisor / 2 - 1;
  for (const std::uint32_t value : {high, period}) {
    out.add(where, static_cast<std::uint16_t>(value & 0xFFFFu));
    out.add(where, static_cast<std::uint16_t>(value >> 16));
  }
  out.add(Register::TimerControl, timer == Timer::Timer0 ? timer::kStart0 : timer::kStart1);
  return out;
}

Sequence stop_sequence() ABBE_RT {
  Sequence out;
  disarm(out);
  out.add(Register::Acquisition, acquisition::kEnd);
  return out;
}

Sequence load_sequence(const ScanLayout& layout, std::uint64_t divisor) ABBE_RT {
  Sequence out;
  const auto list = encode(layout);
  // The list is loaded twice, as in the manufacturer's library.
  for (int pass = 0; pass < 2; ++pass) {
    out.add(Register::Acquisition, acquisition::kResetScanList);
    for (const auto& entry : list.used()) {
      out.add(Register::ScanList, entry.word1);
      out.add(Register::ScanList, entry.word2);
    }
    out.add(Register::Acquisition, acquisition::kResetSetpoints);
    out.add(Register::Acquisition, acquisition::kDigitalEnhancedOff);
    out.add(Register::ConversionRate, 0);
  }
  disarm(out);
  out.add(Register::Acquisition, acquisition::kEnd);
  out.add(Register::Acquisition, acquisition::kPacerNormal);
  out.add(Register::PacerDivisorLow, static_cast<std::uint16_t>(divisor & 0xFFFFu));
  out.add(Register::PacerDivisorMiddle, static_cast<std::uint16_t>(divisor >> 16 & 0xFFFFu));
  out.add(Register::PacerDivisorHigh, static_cast<std::uint16_t>(divisor >> 32 & 0xFFFFu));
  out.add(Register::Acquisition, acquisition::kResetResults);
  out.add(reset_scan_endpoint());
  out.add(usb::clear_halt(kScanEndpoint));

  return out;
}

Sequence arm_sequence() ABBE_RT {
  Sequence out;
  out.add(Register::DmaControl, dma::kChannel1On);
  out.add(Register::Acquisition, acquisition::kStartSetpoints);
  out.add(Register::Acquisition, acquisition::kStartScanList);
  return out;
}

}  // namespace abbe::protocol::quad08
