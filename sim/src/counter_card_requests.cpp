// Answers of the card on endpoint 0.
#include <algorithm>
#include <utility>

#include "abbe/protocol/bytes.hpp"
#include "abbe/protocol/quad08/stream.hpp"
#include "abbe/protocol/usb/descriptors.hpp"
#include "abbe/sim/counter_card.hpp"

namespace abbe::sim {
namespace {

using quad08::Register;
using quad08::Status;
using Answer = std::optional<std::vector<std::byte>>;

constexpr std::uint8_t kManufacturerString = 1;
constexpr std::uint8_t kProductString = 2;
constexpr std::uint8_t kSerialString = 3;
constexpr std::uint16_t kCounterBits = 0x07;
// Banks from this number on hold the words of the modulus. They are ignored: the counters use their
// whole range.
constexpr std::uint16_t kModulusBanks = 0x10;

constexpr std::uint16_t number(Register where) {
  return static_cast<std::uint16_t>(where);
}

std::vector<std::byte> word(std::uint16_t value) {
  return {static_cast<std::byte>(value & 0xFFu), static_cast<std::byte>(value >> 8)};
}

template <class... B>
std::vector<std::byte> data_of(B... b) {
  return {static_cast<std::byte>(b)...};
}

std::vector<std::byte> configuration() {
  constexpr unsigned kLength = 25;
  return data_of(9, 2, kLength, 0, 1, quad08::kConfiguration, 0, 0x80, 250,  // bus powered, 500 mA
                 9, 4, 0, 0, 1, 0xFF, 0, 0, 0,                               // one vendor interface
                 7, 5, quad08::kScanEndpoint, 2, quad08::kPacketSize & 0xFFu,
                 quad08::kPacketSize >> 8, 0);
}

std::vector<std::byte> string(std::string_view text) {
  std::array<std::byte, usb::kMaxDescriptor> out{};
  const auto size = usb::encode_string(text, out);
  return {out.begin(), out.begin() + static_cast<std::ptrdiff_t>(size)};
}

}  // namespace

Answer CounterCard::control(const usb::Setup& setup, HostTime now) {
  Answer answer;
  const auto request = static_cast<quad08::Request>(setup.request);
  const bool vendor = (setup.request_type & 0x60u) == 0x40u;

  if (!vendor) {
    answer = standard(setup);
  } else if (request == quad08::Request::FirmwareVersion && setup.device_to_host()) {
    answer = word(options_.firmware);
  } else if (request == quad08::Request::Register && setup.device_to_host()) {
    answer = word(read_register(setup.index, now));
  } else if (request == quad08::Request::Register) {
    write_register(setup.index, setup.value, now);
    answer.emplace();
  } else if (request == quad08::Request::EndpointReset) {
    answer.emplace();
  }

  if (answer && answer->size() > setup.length) answer->resize(setup.length);
  return answer;
}

ControlAnswer CounterCard::answer(const usb::Setup& setup, HostTime now) {
  if (failing_controls_ > 0) {
    --failing_controls_;
    return {ControlAnswer::Outcome::Stalled, {}};
  }
  auto data = control(setup, now);
  if (!data) return {ControlAnswer::Outcome::Stalled, {}};
  return {ControlAnswer::Outcome::Done, std::move(*data)};
}

Answer CounterCard::standard(const usb::Setup& setup) {
  switch (static_cast<usb::StandardRequest>(setup.request)) {
    case usb::StandardRequest::GetDescriptor:
      return descriptor(setup);
    case usb::StandardRequest::GetStatus:
      return word(0);
    case usb::StandardRequest::GetConfiguration:
      return data_of(quad08::kConfiguration);
    case usb::StandardRequest::GetInterface:
      return data_of(0);
    case usb::StandardRequest::ClearFeature:
    case usb::StandardRequest::SetFeature:
    case usb::StandardRequest::SetAddress:
    case usb::StandardRequest::SetConfiguration:
    case usb::StandardRequest::SetInterface:
      return std::vector<std::byte>{};
  }

  return std::nullopt;
}

Answer CounterCard::descriptor(const usb::Setup& setup) const {
  switch (static_cast<usb::DescriptorType>(setup.value >> 8)) {
    case usb::DescriptorType::Device: {
      const auto d = usb::encode(usb::DeviceDescriptor{.vendor = options_.vendor,
                                                       .product = options_.product,
                                                       .manufacturer_string = kManufacturerString,
                                                       .product_string = kProductString,
                                                       .serial_string = kSerialString});
      return std::vector(d.begin(), d.end());
    }
    case usb::DescriptorType::Configuration:
      return configuration();
    case usb::DescriptorType::String:
      switch (setup.value & 0xFFu) {
        case 0:
          return data_of(4, 3, usb::kEnglish & 0xFFu, usb::kEnglish >> 8);
        case kManufacturerString:
          return string("abbe-sim");
        case kProductString:
          return string("counter card");
        case kSerialString:
          return string(options_.serial);
        default:
          return std::nullopt;
      }
    case usb::DescriptorType::Interface:
    case usb::DescriptorType::Endpoint:
      break;
  }

  return std::nullopt;
}

std::uint16_t CounterCard::read_register(std::uint16_t where, HostTime now) {
  if (where == number(Register::Acquisition)) return status();
  if (where == number(Register::Mark)) return corrupted_mark_.value_or(mark_);
  const auto first = number(Register::CounterWord0);
  if (where >= first && where < first + 4) {
    return static_cast<std::uint16_t>(value_of(bank_ & kCounterBits, now) >> 16 * (where - first) &
                                      0xFFFFu);
  }
  return 0;
}

std::uint16_t CounterCard::status() const {
  unsigned bits = 0;
  if (!fifo_.empty()) bits |= Status::kMoreSamples | Status::kValidData;
  if (overrun_) bits |= Status::kFifoOverrun;
  if (list_started_) bits |= Status::kPipeFull;
  if (scan_words_.empty()) bits |= Status::kScanListEmpty;
  return static_cast<std::uint16_t>(bits);
}

void CounterCard::write_register(std::uint16_t where, std::uint16_t value, HostTime now) {
  const auto divisor_part = [&](unsigned shift) {
    divisor_ = (divisor_ & ~(std::uint64_t{0xFFFF} << shift)) | std::uint64_t{value} << shift;
  };

  switch (static_cast<Register>(where)) {
    case Register::Acquisition:
      return control_acquisition(value, now);
    case Register::ScanList:
      return scan_words_.push_back(value);
    case Register::PacerDivisorLow:
      return divisor_part(0);
    case Register::PacerDivisorMiddle:
      return divisor_part(16);
    case Register::PacerDivisorHigh:
      return divisor_part(32);
    case Register::DmaControl:
      if (value == quad08::dma::kChannel1On) dma_ = true;
      if (value == quad08::dma::kChannel1Off) dma_ = false;
      return;
    case Register::CounterBank:
      bank_ = value;
      return;
    case Register::CounterSetup:
      return set_up_counter(value, now);
    case Register::TimerControl:
      return control_timer(value, now);
    case Register::Timer0Divisor:
      timer_words_.push_back(value);
      if (timer_words_.size() > 4) timer_words_.erase(timer_words_.begin());
      return;
    case Register::Mark:
      mark_ = value & 0xFFu;
      return;
    case Register::SetpointFifo:
    case Register::ConversionRate:
    case Register::DacControl:
    case Register::DebouncePhases:
    case Register::DebounceIndex:
    case Register::CounterWord0:
    case Register::Timer1Divisor:
    case Register::TriggerControl:
      return;  // accepted without effect in the simulation
  }
}

void CounterCard::control_acquisition(std::uint16_t value, HostTime now) {
  namespace acquisition = quad08::acquisition;
  switch (value) {
    case acquisition::kResetScanList:
      scan_words_.clear();
      break;
    case acquisition::kResetResults:
      fifo_.clear();
      overrun_ = false;
      break;
    case acquisition::kStopScanList:
      list_started_ = false;
      break;
    case acquisition::kPacerOff:
      pacing_ = false;
      break;
    case acquisition::kStartScanList: {
      std::vector<quad08::ScanListEntry> entries;
      for (std::size_t i = 0; i + 1 < scan_words_.size(); i += 2)
        entries.push_back({scan_words_[i], scan_words_[i + 1]});
      const auto layout = quad08::decode_scan_list(entries);
      list_started_ = layout.has_value();
      layout_ = layout.value_or(quad08::ScanLayout{});
      break;
    }
    case acquisition::kPacerInternal:
      pacing_ = list_started_ && dma_;
      pacer_began_ = now;
      next_scan_ = 1;  // the first scan follows one period after the start
      for (Counter& counter : counters_) counter.last_reading.reset();
      break;
    default:
      break;  // the signal of an external pacer is not simulated
  }
}

void CounterCard::set_up_counter(std::uint16_t value, HostTime now) {
  if (bank_ >= kModulusBanks) return;
  const auto setup = quad08::decode_counter_setup(value);
  const std::size_t channel = bank_ & kCounterBits;
  counters_[channel] = Counter{};
  counters_[channel].set_up = true;
  if (setup) counters_[channel].setup = *setup;
  counters_[channel].zero = signal_count(channel, now);
  counters_[channel].set_up_at = now;
}

void CounterCard::control_timer(std::uint16_t value, HostTime now) {
  if (value == quad08::timer::kStart0) timer_began_ = now;
  if (value == quad08::timer::kStop0) timer_began_.reset();
}

}  // namespace abbe::sim
