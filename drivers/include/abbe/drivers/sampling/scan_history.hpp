#pragma once
/// The latest scans of a counter card, and the axis positions at an instant of its clock. Instants
/// are nanoseconds of the card's clock, so that errors of the mapping to host time do not affect
/// positions. Fixed memory, allocated by the constructor. Real time; one thread.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <tl/expected.hpp>

#include "abbe/drivers/counter_card/scan.hpp"
#include "abbe/drivers/interpolation.hpp"
#include "abbe/drivers/ring_slots.hpp"

namespace abbe::drivers {

class ScanHistory {
 public:
  /// Capacity is rounded up to a power of two, at least 8. Allocates.
  ScanHistory(std::size_t capacity, double clock_hz);

  /// Precondition: the clock counts of successive scans increase. So call clear() after a restart
  /// of the card.
  void push(const CounterScan& scan) ABBE_RT;
  void clear() ABBE_RT;

  [[nodiscard]] bool empty() const ABBE_RT { return begin_ == end_; }
  /// Scans are numbered since construction; those in [begin_number, end_number) are kept.
  [[nodiscard]] std::uint64_t begin_number() const ABBE_RT { return begin_; }
  [[nodiscard]] std::uint64_t end_number() const ABBE_RT { return end_; }
  [[nodiscard]] const CounterScan& scan(std::uint64_t number) const ABBE_RT {
    return slots_[static_cast<std::size_t>(number) & mask_];
  }
  [[nodiscard]] const CounterScan& newest() const ABBE_RT { return scan(end_ - 1); }

  /// Number of the first kept scan later than `instant`; end_number() if there is none.
  [[nodiscard]] std::uint64_t first_after(protocol::DeviceTime instant) const ABBE_RT;

  /// Instant of a clock count: the middle of the clock period with this count.
  [[nodiscard]] protocol::DeviceTime instant(std::int64_t clock_count) const ABBE_RT;
  [[nodiscard]] double clock_period_s() const ABBE_RT { return period_s_; }

  /// Axis positions at `instant`; `u_position` contains only the uncertainty of the interpolation.
  /// `host_time` is the host time of `instant`.
  struct At {
    AxesAt axes;
    protocol::HostTime host_time{};
    std::chrono::nanoseconds u_host_time{};
  };
  [[nodiscard]] tl::expected<At, InterpolationError> at(
      protocol::DeviceTime instant, const InterpolationOptions& options) const ABBE_RT;

 private:
  RingSlots<CounterScan> slots_;
  std::size_t mask_;
  double period_s_;
  std::uint64_t begin_ = 0;
  std::uint64_t end_ = 0;
};

}  // namespace abbe::drivers
