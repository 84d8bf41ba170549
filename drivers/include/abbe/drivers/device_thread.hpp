#pragma once
/// The real-time loop, once for all drivers: wait() in the ordinary world, receive() in real time,
/// until told to stop. Memory is locked and the stack touched, scheduling and affinity are set
/// before the first turn. An exception out of wait() ends the loop, which begins again after a
/// pause that doubles from time to time.

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/error.hpp"
#include "abbe/drivers/latency_histogram.hpp"

namespace abbe::drivers {

enum class RealTimeMode {
  Enforce,  ///< what the system refuses (memory lock, priority, affinity) is an error: do not start
  Ignore,   ///< what the system refuses is a warning: tests, laptops
};

struct DeviceThreadOptions {
  std::string name = "device";  ///< shown by top; the kernel keeps 15 characters
  RealTimeMode mode = RealTimeMode::Ignore;
  bool lock_memory = false;  ///< lock_memory() of real_time_memory.hpp; of the whole process
  int priority = 0;          ///< SCHED_FIFO 1..99; 0 stays with the ordinary scheduler
  std::optional<int> cpu;    ///< the one processor to run on; none: anywhere
  std::chrono::nanoseconds wait_at_most =
      std::chrono::milliseconds{50};  ///< host time; also how soon stop() is heard
  /// Pause after an exception (wall time). Doubled each time, up to the longest; the first one
  /// again once the loop has run for the longest.
  std::chrono::nanoseconds first_back_off = std::chrono::seconds{1};
  std::chrono::nanoseconds longest_back_off = std::chrono::seconds{30};
};

/// Owns the thread, not the device: the device must outlive it. Functions may be called from any
/// one other thread, latency() and failure() from any.
class DeviceThread {
 public:
  /// Starts the loop, or says what the system refused. The device is not touched when it fails.
  [[nodiscard]] static Result<std::unique_ptr<DeviceThread>> start(Device& device,
                                                                   DeviceThreadOptions options);

  DeviceThread(const DeviceThread&) = delete;
  DeviceThread& operator=(const DeviceThread&) = delete;
  /// Stops.
  ~DeviceThread();

  /// Asks the loop to end and waits for it: at most one wait() and one receive(). Safe to call
  /// again.
  void stop();

  /// What the system refused in mode Ignore, one sentence each; empty in mode Enforce.
  [[nodiscard]] const std::vector<std::string>& warnings() const noexcept;
  /// From wait() having returned to receive() having returned.
  [[nodiscard]] const LatencyHistogram& latency() const noexcept;
  /// The exception that ended the loop, in words, until it runs again: what the device reports of
  /// itself is not true meanwhile. None while it runs or if it was stopped. Takes no lock.
  [[nodiscard]] std::optional<std::string> failure() const;
  /// What the device reports of itself; while its loop has ended: not connected, "internal error",
  /// and the cause. Each failure of the loop counts as a fault.
  [[nodiscard]] DeviceStatus status() const;
  /// How often an exception ended the loop.
  [[nodiscard]] std::uint64_t failures() const noexcept;

 private:
  struct State;
  explicit DeviceThread(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::drivers
