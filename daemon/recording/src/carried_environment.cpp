#include "carried_environment.hpp"

#include <algorithm>

namespace abbe::daemon::recording {

using protocol::EnvironmentMask;
using protocol::EnvironmentSample;
using protocol::HostTime;

namespace {

/// The sample with lost_before = 0, because the original message has already reported the loss.
EnvironmentSample without_gap(EnvironmentSample sample) {
  sample.head.lost_before = 0;
  sample.head.flags &= ~static_cast<protocol::SampleFlags>(protocol::SampleFlag::GapBefore);
  return sample;
}

}  // namespace

std::size_t CarriedEnvironment::number_of(std::string_view device) {
  const auto known = std::ranges::find(names_, device);
  if (known != names_.end()) return static_cast<std::size_t>(known - names_.begin());
  names_.emplace_back(device);
  return names_.size() - 1;
}

void CarriedEnvironment::take(const EnvironmentSample& sample, std::string_view device,
                              HostTime taken) {
  const auto mask = static_cast<EnvironmentMask>(sample.measured & queue_.checks().mask_of(device));
  const std::size_t number = number_of(device);
  if (device == weather_station_)
    queue_.add_weather(number, without_gap(sample), mask, taken);
  else
    queue_.add(number, without_gap(sample), mask, taken);
  check_until(taken - watermark_);
}

void CarriedEnvironment::check_until(HostTime t) {
  queue_.check_until(t, [&](const SensorQueue::Waiting& read, const CheckedEnvironment&) {
    auto [last, fresh] = checked_.try_emplace(names_[read.device], read.sample);
    // The sample arrived too late: the pipeline does not use a sample that is earlier than one it
    // has used.
    if (!fresh && read.sample.head.time >= last->second.head.time) last->second = read.sample;
    state_at_ = std::max(state_at_, read.sample.head.time);
  });
}

}  // namespace abbe::daemon::recording
