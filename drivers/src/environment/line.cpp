#include "abbe/drivers/environment/line.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <thread>

#include "abbe/result/try.hpp"

namespace abbe::drivers {

using protocol::HostTime;
using std::chrono::nanoseconds;

namespace {

/// A late answer is complete when no byte has arrived for this time.
constexpr nanoseconds kEndOfLateAnswer = std::chrono::milliseconds{50};

}  // namespace

Result<std::unique_ptr<EnvironmentLine>> EnvironmentLine::create(
    const std::vector<EnvironmentDeviceOptions>& options, const TimeSource& time) {
  if (options.empty())
    return tl::unexpected(Error{ErrorCode::BadConfiguration, "a Modbus line without a device"});
  const ModbusAddress& address = options.front().address;
  std::unique_ptr<EnvironmentLine> line{new EnvironmentLine{silence_between(address), time}};

  for (const auto& o : options) {
    if (!same_line(o.address, address) || !same_settings(o.address, address))
      return tl::unexpected(
          Error{ErrorCode::BadConfiguration,
                fmt::format("{} {} and {} {} are not on the same line", options.front().name,
                            text_of(address), o.name, text_of(o.address))});
    auto device = EnvironmentDevice::create(o, time, line->link_);
    ABBE_TRY(device);
    line->devices_.push_back(std::move(*device));
  }

  return line;
}

void EnvironmentLine::wait(nanoseconds at_most) {
  const bool alone = devices_.size() == 1;
  EnvironmentDevice& device = next();
  active_ = nullptr;

  if (!device.busy()) {
    if (!alone && must_be_quiet()) return discard_late_answer(device, at_most);
    const auto now = time_.now();
    if (!device.on_line() && now < device.due())
      return std::this_thread::sleep_for(
          time_.wall(std::min(at_most, nanoseconds{device.due() - now})));
  }

  active_ = &device;
  device.wait(at_most);
  if (link_.line.is_open()) return;
  for (const auto& other : devices_)
    if (other.get() != &device) other->line_closed();
}

/// The device to serve next: the one with an outstanding or unhandled answer, else the one that has
/// waited longest. If several have waited equally long, it is the next one after the device chosen
/// last.
EnvironmentDevice& EnvironmentLine::next() {
  for (const auto& device : devices_)
    if (device->busy()) return *device;
  std::size_t first = (last_ + 1) % devices_.size();
  for (std::size_t k = 2; k <= devices_.size(); ++k) {
    const std::size_t i = (last_ + k) % devices_.size();
    if (devices_[i]->due() < devices_[first]->due()) first = i;
  }
  last_ = first;
  return *devices_[first];
}

/// True while the line must stay silent: after an answer and before the next request, and while a
/// late answer may still arrive.
bool EnvironmentLine::must_be_quiet() {
  if (std::exchange(answers_seen_, link_.answers) != link_.answers)
    link_.quiet_until = std::max(link_.quiet_until, time_.now() + silence_);
  return link_.line.is_open() && time_.now() < link_.quiet_until;
}

/// Reads and discards a late answer, which would be taken for the answer to the next request.
void EnvironmentLine::discard_late_answer(EnvironmentDevice& device, nanoseconds at_most) {
  std::array<std::byte, modbus::kMaxAduSize> bytes{};
  const auto budget =
      std::clamp(nanoseconds{link_.quiet_until - time_.now()}, nanoseconds{0}, at_most);
  const auto read = link_.line.read(bytes, time_.wall(budget));
  if (!read) device.lose(read.error().text);
  if (read && *read != 0) link_.quiet_until = time_.now() + kEndOfLateAnswer;
}

}  // namespace abbe::drivers
