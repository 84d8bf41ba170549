// The real-time part of the environment device: converts the bytes that wait() read to samples.
#include <utility>

#include "abbe/drivers/environment/device.hpp"
#include "abbe/drivers/environment/line.hpp"

namespace abbe::drivers {

void EnvironmentDevice::receive() ABBE_RT {
  const auto bytes = std::span<const std::byte>{buffer_}.first(std::exchange(filled_, 0));
  if (bytes.empty()) return;
  raw_.push_bytes(arrival_, protocol::RawBlock::Direction::FromDevice, bytes);
  progress_ = receiver_.push(bytes, arrival_);
  if (progress_ != Progress::Sample) return;
  samples_.try_push(receiver_.sample());
  board_.samples.add();
  board_.set_last_sample(receiver_.sample().head.time);
}

void EnvironmentLine::receive() ABBE_RT {
  if (active_ != nullptr) active_->receive();
}

}  // namespace abbe::drivers
