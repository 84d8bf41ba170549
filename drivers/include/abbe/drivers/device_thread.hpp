#pragma once
/// The real-time loop of all drivers. It calls wait() (not real-time) and receive() (real time)
/// alternately until stop(). Before the first cycle the thread locks memory, touches its stack, and
/// sets scheduling and affinity. An exception thrown by wait() ends the loop; the device then stops
/// its motion at once (stop_after_failure()). The loop starts again after a pause, which doubles
/// with each further exception. While a motion may still continue, there is no pause.

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/error.hpp"
#include "abbe/drivers/latency_histogram.hpp"
#include "abbe/drivers/real_time_mode.hpp"

namespace abbe::drivers {

struct DeviceThreadOptions {
  std::string name = "device";  ///< shown by top; the kernel keeps 15 characters
  RealTimeMode mode = RealTimeMode::Ignore;
  bool lock_memory = false;  ///< call lock_memory() of real_time_memory.hpp (whole process)
  int priority = 0;          ///< SCHED_FIFO 1..99; 0 keeps the ordinary scheduler
  std::optional<int> cpu;    ///< the only processor to run on; nullopt: any
  /// Longest time of one wait() of the device, host time. It is also the longest time until the
  /// loop reacts to stop().
  std::chrono::nanoseconds wait_at_most = std::chrono::milliseconds{50};
  /// Pause after an exception (wall time). It doubles with each exception up to longest_back_off.
  /// It returns to first_back_off once the loop has run for longest_back_off.
  std::chrono::nanoseconds first_back_off = std::chrono::seconds{1};
  std::chrono::nanoseconds longest_back_off = std::chrono::seconds{30};
};

/// Runs the loop of a device on a thread. Owns the thread, not the device: the device must outlive
/// it. The functions may be called from one other thread; latency() and failure() from any thread.
class DeviceThread {
 public:
  /// Starts the loop. Error SystemRefused: the system refused the thread or, in mode Enforce, a
  /// setting; no function of the device has then been called.
  [[nodiscard]] static Result<std::unique_ptr<DeviceThread>> start(Device& device,
                                                                   DeviceThreadOptions options);

  DeviceThread(const DeviceThread&) = delete;
  DeviceThread& operator=(const DeviceThread&) = delete;
  /// Calls stop().
  ~DeviceThread();

  /// Ends the loop and waits until it has ended: at most one wait() and one receive(). May be
  /// called again.
  void stop();

  /// Settings that the system refused in mode Ignore, one sentence each; empty in mode Enforce.
  [[nodiscard]] const std::vector<std::string>& warnings() const noexcept;
  /// Times from the return of wait() to the return of receive().
  [[nodiscard]] const LatencyHistogram& latency() const noexcept;
  /// Text of the exception that ended the loop, until the loop runs again. Meanwhile the device's
  /// own status is out of date. nullopt while the loop runs or after stop(). Takes no lock.
  [[nodiscard]] std::optional<std::string> failure() const;
  /// The status of the device. After an exception has ended the loop and until it runs again, the
  /// status is: not connected, state "internal error", and the cause. Each failure of the loop
  /// counts as a fault.
  [[nodiscard]] DeviceStatus status() const;
  /// Number of exceptions that ended the loop.
  [[nodiscard]] std::uint64_t failures() const noexcept;

 private:
  struct State;
  explicit DeviceThread(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::drivers
