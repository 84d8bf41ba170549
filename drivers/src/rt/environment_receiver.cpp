// The real-time part of the environment receiver: converts answers to samples.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "abbe/drivers/environment/receiver.hpp"

namespace abbe::drivers {

using Kind = EnvironmentFailure::Kind;
using Progress = EnvironmentReceiver::Progress;
using protocol::HostTime;

void EnvironmentReceiver::begin() ABBE_RT {
  begun_ = true;
  proven_ = proving_reads_.empty();
  first_round_ = true;
  read_ = 0;
  pending_.reset();
  filled_ = 0;
  failure_ = {};
}

std::optional<modbus::ReadRequest> EnvironmentReceiver::next_request() const ABBE_RT {
  if (!begun_ || pending_ || failure_.kind != Kind::None) return std::nullopt;
  return proven_ ? reads_[read_] : proving_reads_[read_];
}

void EnvironmentReceiver::sent(const modbus::ReadRequest& request, HostTime at) ABBE_RT {
  if (between_rounds()) asked_ = at;
  pending_ = request;
  filled_ = 0;
}

Progress EnvironmentReceiver::push(std::span<const std::byte> bytes, HostTime at) ABBE_RT {
  if (!begun_ || failure_.kind != Kind::None || bytes.empty()) return Progress::Waiting;
  if (!pending_) return fail({.kind = Kind::Unasked});
  if (bytes.size() > bytes_.size() - filled_)
    return fail({.kind = Kind::Malformed,
                 .error = modbus::DecodeError::TrailingBytes,
                 .request = *pending_});
  std::copy(bytes.begin(), bytes.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(filled_));
  filled_ += bytes.size();
  const auto answer =
      modbus::decode_answer(std::span{bytes_}.first(filled_), transport_, *pending_);
  if (!answer) return Progress::Waiting;
  if (!*answer)
    return fail({.kind = Kind::Malformed, .error = answer->error(), .request = *pending_});
  if ((*answer)->exception)
    return fail(
        {.kind = Kind::Exception, .exception = *(*answer)->exception, .request = *pending_});
  answered_ = at;
  return accept((*answer)->registers);
}

Progress EnvironmentReceiver::fail(const EnvironmentFailure& failure) ABBE_RT {
  failure_ = failure;
  pending_.reset();
  return Progress::Failed;
}

Progress EnvironmentReceiver::accept(std::span<const std::byte> registers) ABBE_RT {
  return proven_ ? measure(registers) : prove(registers);
}

Progress EnvironmentReceiver::prove(std::span<const std::byte> registers) ABBE_RT {
  const auto& proving = map_.proving[read_];
  const double value = modbus::decode_register(registers, proving.place.type, proving.place.order);
  if (!(value == proving.expected))  // the comparison also fails for NaN
    return fail({.kind = Kind::Unproven, .index = read_, .value = value, .request = *pending_});
  pending_.reset();
  if (++read_ == proving_reads_.size()) {
    proven_ = true;
    read_ = 0;
  }
  return Progress::Answered;
}

Progress EnvironmentReceiver::measure(std::span<const std::byte> registers) ABBE_RT {
  if (read_ == 0) {
    building_ = {};
    building_.measured = 0;
    building_.air_temperature_K = building_.air_pressure_Pa = building_.relative_humidity =
        std::numeric_limits<double>::quiet_NaN();
  }
  for (std::size_t i = 0; i < spots_.size(); ++i) {
    if (spots_[i].read != read_) continue;
    const auto& place = map_.measured[i].place;
    const auto bytes =
        registers.subspan(spots_[i].byte, std::size_t{2} * modbus::register_count(place.type));
    if (!take_value(i, modbus::decode_register(bytes, place.type, place.order)))
      return Progress::Failed;
  }

  pending_.reset();
  if (++read_ < reads_.size()) return Progress::Answered;
  finish_round();

  return Progress::Sample;
}

bool EnvironmentReceiver::take_value(std::size_t index, double raw) ABBE_RT {
  const MeasuredRegister& m = map_.measured[index];
  const bool absent = std::isnan(raw) || std::find(m.unavailable.begin(), m.unavailable.end(),
                                                   raw) != m.unavailable.end();
  double value = raw * m.scale + m.offset;
  const PlausibleRange range = plausible_range(m.quantity);
  if (absent) {
    ++counters_.unavailable;
    value = std::numeric_limits<double>::quiet_NaN();
  } else if (value < range.min || value > range.max) {
    if (first_round_) {
      (void)fail({.kind = Kind::Implausible, .index = index, .value = value, .request = *pending_});
      return false;
    }
    ++counters_.implausible;
    value = std::numeric_limits<double>::quiet_NaN();
  }
  building_.measured |= mask_of(m);
  switch (m.quantity) {
    case Quantity::AirTemperature:
      building_.air_temperature_K = value;
      break;
    case Quantity::AirPressure:
      building_.air_pressure_Pa = value;
      break;
    case Quantity::RelativeHumidity:
      building_.relative_humidity = value;
      break;
    case Quantity::Temperature:
      building_.temperature_K[m.channel] = value;
      break;
  }

  return true;
}

void EnvironmentReceiver::finish_round() ABBE_RT {
  read_ = 0;
  sample_ = building_;
  const auto width = answered_ - asked_;
  sample_.head.time = asked_ + width / 2;
  sample_.head.u_time = std::chrono::nanoseconds{
      std::llround(static_cast<double>(width.count()) / (2.0 * std::numbers::sqrt3))};
  if (first_round_) sample_.head.flags |= protocol::SampleFlag::Restarted;
  first_round_ = false;
  ++counters_.samples;
}

bool EnvironmentReceiver::on_raw(const protocol::RawBlock& block) ABBE_RT {
  const auto bytes = std::span{block.bytes}.first(block.length);
  if (block.lost_before != 0) begun_ = false;
  if (block.direction == protocol::RawBlock::Direction::ToDevice) {
    const auto request = modbus::decode_request(bytes, transport_);
    if (!request) return false;
    if (!begun_ && *request == reads_.front()) join();
    if (*request == next_request()) sent(*request, block.time);
    return false;
  }
  if (bytes.empty()) begin();
  return push(bytes, block.time) == Progress::Sample;
}

/// Begins decoding in the middle of a recording, or after missing blocks, as at the start of a
/// round.
void EnvironmentReceiver::join() ABBE_RT {
  begin();
  proven_ = true;
  first_round_ = false;
}

}  // namespace abbe::drivers
