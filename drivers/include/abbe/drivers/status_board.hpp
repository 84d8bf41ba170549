#pragma once
/// What a device knows of itself, written by its one thread (also in real time: no lock, no
/// allocation), read by any. A member of every driver; `read()` is its Device::status().

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

/// A count with one writer: no read-modify-write, so it costs an ordinary increment.
class Counter {
 public:
  void add(std::uint64_t n = 1) ABBE_RT {
    value_.store(value_.load(std::memory_order_relaxed) + n,
                 std::memory_order_relaxed);  // a count orders nothing
  }
  [[nodiscard]] std::uint64_t value() const noexcept {
    return value_.load(std::memory_order_relaxed);
  }

 private:
  std::atomic<std::uint64_t> value_{0};
};

/// The latest text, cut at kCapacity, replaced without locks. There is room for two: while one is
/// written the other can be read, so that a reader of high priority never waits for a writer that
/// was preempted. A reader tries again only if two texts were begun while it read. The writer never
/// waits. [Boehm 2012] for the fences of a seqlock.
class FaultText {
 public:
  static constexpr std::size_t kCapacity = 248;  ///< as much as a Health message carries

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
  std::array<Text, 2> texts_;            ///< the n-th text lies in texts_[n % 2]
  std::atomic<std::uint64_t> begun_{0};  ///< texts whose writing has begun
  std::atomic<std::uint64_t> complete_{0};
};

class StatusBoard {
 public:
  Counter samples, gaps, faults, time_widened;

  /// `literal` must live for ever: a string literal of the driver.
  void set_state(const char* literal) ABBE_RT {
    state_.store(literal, std::memory_order_release);  // release: pairs with the acquire in read()
  }
  /// What keeps the device from measuring though it is no fault ("no beam"): the text alone, not
  /// counted.
  void note(protocol::HostTime at, std::string_view text) ABBE_RT { fault_text_.set(at, text); }
  void set_connected(bool yes) ABBE_RT { connected_.store(yes, std::memory_order_relaxed); }
  void set_last_sample(protocol::HostTime t) ABBE_RT {
    last_sample_ns_.store(t.time_since_epoch().count(), std::memory_order_relaxed);
  }
  void set_clock(const ClockStatus& clock) ABBE_RT;
  /// Counts the fault and keeps its text. For the rare: text is composed by the caller, without
  /// allocating if in RT.
  void fault(protocol::HostTime at, std::string_view text) ABBE_RT {
    faults.add();
    fault_text_.set(at, text);
  }

  /// What is wrong from now on; empty: nothing.
  void set_condition(protocol::HostTime now, std::string_view text) ABBE_RT {
    condition_.set(now, text);
  }

  /// Any thread; allocates. The rings' own counts are handed in, so that they are kept once.
  [[nodiscard]] DeviceStatus read(std::string name, std::uint64_t dropped,
                                  std::uint64_t raw_dropped) const;

 private:
  // Each is an independent figure for people: relaxed, nothing is ordered by them.
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
