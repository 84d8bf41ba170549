#pragma once
/// Code shared by all kinds of devices: a driver with its thread, and draining of its rings.

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"
#include "abbe/drivers/device_thread.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// Advice in messages about a simulated device; for a real device the advice is to have it
/// serviced.
inline constexpr std::string_view kBusyComputer =
    "the device is simulated: this computer is too busy for it, give it less to do or a lower "
    "speed";

/// Most elements that are popped from a ring at once; several bursts of a device fit.
inline constexpr std::size_t kMostSamples = 1024;
inline constexpr std::size_t kMostBlocks = 128;

using BlockBuffer = std::array<protocol::RawBlock, kMostBlocks>;

[[nodiscard]] Error error_of(const drivers::Error& error);
[[nodiscard]] drivers::DeviceThreadOptions thread_options(const DaemonConfig& config,
                                                          std::string name, int priority,
                                                          std::optional<int> cpu);

template <class Ring, class T, std::size_t N>
void drain_ring(Ring& ring, std::array<T, N>& buffer, std::vector<T>& out) {
  for (std::size_t n = buffer.size(); n == buffer.size();) {
    n = ring.pop(buffer);
    out.insert(out.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(n));
  }
}

/// Drains the raw blocks of a device. `device`: index in DeviceNames::all.
template <class Ring>
void drain_raw(Ring& ring, BlockBuffer& buffer, std::size_t device, Batch& batch) {
  for (std::size_t n = buffer.size(); n == buffer.size();) {
    n = ring.pop(buffer);
    for (std::size_t i = 0; i < n; ++i) {
      RawFromDevice& raw = batch.raw.emplace_back();
      raw.device = device;
      raw.block = buffer[i];
    }
  }
}

/// A driver and its thread. Members are destroyed in reverse order: the thread ends before the
/// driver is destroyed.
template <class D>
struct Running {
  std::unique_ptr<D> device;
  std::unique_ptr<drivers::DeviceThread> thread;
};

template <class D>
// `options` is moved; clang-tidy 14 does not detect this in a template.
// NOLINTNEXTLINE(performance-unnecessary-value-param)
Result<Running<D>> run(drivers::Result<std::unique_ptr<D>> device,
                       drivers::DeviceThreadOptions options) {
  if (!device) return tl::unexpected(error_of(device.error()));
  auto thread = drivers::DeviceThread::start(**device, std::move(options));
  if (!thread) return tl::unexpected(error_of(thread.error()));
  return Running<D>{std::move(*device), std::move(*thread)};
}

}  // namespace abbe::daemon
