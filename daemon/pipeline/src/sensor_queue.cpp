#include "abbe/pipeline/sensor_queue.hpp"

#include <algorithm>
#include <bit>
#include <tuple>
#include <utility>

namespace abbe::daemon {

using protocol::EnvironmentMask;
using protocol::EnvironmentSample;
using protocol::HostTime;

namespace {

/// Order of waiting samples. For equal instants the lowest quantity decides, because the devices of
/// a machine measure different quantities; the numbers of the devices have no influence.
auto order_of(const SensorQueue::Waiting& waiting) {
  return std::tuple{waiting.due, waiting.weather, waiting.sample.head.time,
                    std::countr_zero(waiting.mask)};
}

}  // namespace

void SensorQueue::insert(const Waiting& waiting, HostTime taken) {
  const HostTime at = waiting.sample.head.time;
  if (taken != HostTime{} && at - taken > kMostAhead)
    return checks_.note_future(waiting.mask, taken, at - taken);
  const auto later = [](const Waiting& a, const Waiting& b) { return order_of(a) < order_of(b); };
  waiting_.insert(std::upper_bound(waiting_.begin(), waiting_.end(), waiting, later), waiting);
}

void SensorQueue::add(std::size_t device, const EnvironmentSample& sample, EnvironmentMask mask,
                      HostTime taken) {
  insert({.due = sample.head.time + lag_, .device = device, .mask = mask, .sample = sample}, taken);
}

void SensorQueue::accept(SensorAcceptance acceptance) {
  const auto after =
      std::ranges::upper_bound(acceptances_, acceptance.from, {}, &SensorAcceptance::from);
  acceptances_.insert(after, std::move(acceptance));
}

void SensorQueue::accept_before(HostTime due) {
  auto next = acceptances_.begin();
  for (; next != acceptances_.end() && next->from < due; ++next) checks_.accept(next->sensor);
  acceptances_.erase(acceptances_.begin(), next);
}

void SensorQueue::add_weather(std::size_t device, const EnvironmentSample& sample,
                              EnvironmentMask mask, HostTime taken) {
  insert({.due = taken != HostTime{} ? taken : sample.head.time,
          .weather = true,
          .device = device,
          .mask = mask,
          .sample = sample},
         taken);
}

}  // namespace abbe::daemon
