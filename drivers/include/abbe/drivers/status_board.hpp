#pragma once
/// Status of a device, written by its device thread (also in real time: no lock, no allocation) and
/// read by any thread. Every driver has one as a member; `read()` gives its Device::status().

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "abbe/drivers/device.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

/// A counter with one writer. It needs no atomic read-modify-write, so it costs as much as an
/// ordinary increment.
class Counter {
 public:
  void add(std::uint64_t n = 1) ABBE_RT {
    // relaxed: the count orders no other access
    value_.store(value_.load(std::memory_order_relaxed) + n, std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint64_t value() const noexcept {
    return value_.load(std::memory_order_relaxed);
  }

 private:
  std::atomic<std::uint64_t> value_{0};
};

/// The latest text, truncated to kCapacity, replaced without locks. There are two buffers: one can
/// be read while the other is written, so that a reader of high priority never waits for a
/// preempted writer. A reader repeats its reading only if the writer began two texts meanwhile. The
/// writer never waits. Memory fences as in the seqlock of [Boehm 2012].
class FaultText {
 public:
  static constexpr std::size_t kCapacity = 248;  ///< same as the bound of a Health message

  /// Writer thread.
  void set(protocol::HostTime at, std::string_view text) ABBE_RT;

  struct Read {
    std::string text;
    protocol::HostTime at{};
  };
  /// Any thread; allocates.
  [[nodiscard]] Read read() const;

 private:
  static constexpr std::size_t kWords = kCapacity / sizeof(std::uint64_t);
  struct Text {
    std::atomic<std::uint64_t> length{0};
    std::atomic<std::int64_t> at_ns{0};
    std::array<std::atomic<std::uint64_t>, kWords> words{};
  };
  std::array<Text, 2> texts_;            ///< the n-th text is in texts_[n % 2]
  std::atomic<std::uint64_t> begun_{0};  ///< texts whose writing has begun
  std::atomic<std::uint64_t> complete_{0};
};

class StatusBoard {
 public:
  Counter samples, gaps, faults, time_widened;

  /// `literal` must be a string literal: only the pointer is stored.
  void set_state(const char* literal) ABBE_RT {
    state_.store(literal, std::memory_order_release);  // release: pairs with the acquire in read()
  }
  /// Sets the text of last_fault without counting a fault. For a condition that prevents measuring
  /// but is not a fault ("no beam").
  void note(protocol::HostTime at, std::string_view text) ABBE_RT { fault_text_.set(at, text); }
  void set_connected(bool yes) ABBE_RT { connected_.store(yes, std::memory_order_relaxed); }
  void set_last_sample(protocol::HostTime t) ABBE_RT {
    last_sample_ns_.store(t.time_since_epoch().count(), std::memory_order_relaxed);
  }
  void set_clock(const ClockStatus& clock) ABBE_RT;
  /// Counts a fault and stores its text. For rare events. The caller composes the text; in real
  /// time it must not allocate for that.
  void fault(protocol::HostTime at, std::string_view text) ABBE_RT {
    faults.add();
    fault_text_.set(at, text);
  }

  /// Sets the condition: a text that states the fault from now on; empty: nothing is wrong.
  void set_condition(protocol::HostTime now, std::string_view text) ABBE_RT {
    condition_.set(now, text);
  }

  /// Any thread; allocates. The rings keep the counts of dropped samples and blocks; the caller
  /// passes them in.
  [[nodiscard]] DeviceStatus read(std::string name, std::uint64_t dropped,
                                  std::uint64_t raw_dropped) const;

 private:
  // relaxed: independent values for display, they order no other access.
  std::atomic<const char*> state_{"idle"};
  std::atomic<bool> connected_{false};
  std::atomic<std::int64_t> last_sample_ns_{0};
  std::atomic<bool> clock_settled_{false};
  std::atomic<double> clock_skew_{0.0};
  std::atomic<std::int64_t> clock_residual_ns_{0};
  std::atomic<std::int64_t> clock_u_time_ns_{0};
  std::atomic<std::uint64_t> clock_restarts_{0};
  FaultText fault_text_;
  FaultText condition_;
};

}  // namespace abbe::drivers
