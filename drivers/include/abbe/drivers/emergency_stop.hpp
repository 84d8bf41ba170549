#pragma once
/// Stops moving machines when the process ends without its device threads: after a crash signal, in
/// terminate(), or when an orderly end takes too long. Each connection to such a machine registers
/// its socket, the bytes that stop the machine and the bytes that confirm it.
/// send_emergency_stops() sends the stop bytes from any thread and from a signal handler.

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <string_view>

namespace abbe::drivers {

/// The connection to one machine. Used by one thread, its device thread.
class EmergencyStop {
 public:
  /// `command`, `confirmation`: literals. At most kMostEmergencyStops objects are registered; a
  /// further one has no effect.
  EmergencyStop(std::string_view command, std::string_view confirmation) noexcept;
  /// Returns when no thread uses this object any more.
  ~EmergencyStop();
  EmergencyStop(const EmergencyStop&) = delete;
  EmergencyStop& operator=(const EmergencyStop&) = delete;

  /// The socket of the connection, a descriptor; -1: there is none. Call it with -1 before the
  /// socket is closed: it then returns when no thread uses the descriptor any more.
  void set_socket(int fd) noexcept;
  /// `moving`: a motion was sent, and its end is not known. Call it before the motion is sent.
  void set_moving(bool moving) noexcept { moving_.store(moving, std::memory_order_release); }

 private:
  friend struct EmergencyStops send_emergency_stops(std::chrono::milliseconds) noexcept;
  [[nodiscard]] bool confirmed(int fd, std::chrono::milliseconds within) const noexcept;

  const std::string_view command_, confirmation_;
  std::atomic<int> socket_{-1};
  std::atomic<bool> moving_{false};
};

inline constexpr std::size_t kMostEmergencyStops = 8;

/// Numbers of moving machines, by the result of the stop.
struct EmergencyStops {
  int sent = 0;       ///< the command was handed to the kernel
  int confirmed = 0;  ///< machines of `sent` that confirmed the command in time
  int not_sent = 0;   ///< not connected, or the socket did not take the command
};

/// Sends the command to every machine that moves, then waits at most `within` for each
/// confirmation, because the end of the process may reset the connection. A device thread that
/// still runs may read the confirmation instead; the machine then counts as not confirmed.
/// Async-signal-safe; does not wait for a lock or for space in a socket.
EmergencyStops send_emergency_stops(std::chrono::milliseconds within) noexcept;

}  // namespace abbe::drivers
