#pragma once
/// Common functions of drivers for serial lines. Not real-time.

#include <string>
#include <utility>

#include "abbe/drivers/error.hpp"

namespace abbe::drivers {

enum class Parity : char { None = 'N', Even = 'E', Odd = 'O' };

/// Exclusive lock of a serial line (flock). If the adapter is not plugged in at the start, abbe
/// cannot recognise that two configured paths lead to the same line; the lock then makes the second
/// opening fail. It also excludes other programs that use flock. TIOCEXCL would exclude all
/// programs except those of root, but it stays set after a process is killed while another one has
/// the line open.
class SerialLock {
 public:
  SerialLock() = default;
  SerialLock(SerialLock&& other) noexcept { *this = std::move(other); }
  SerialLock& operator=(SerialLock&& other) noexcept;
  ~SerialLock();  ///< releases the lock

  /// Locks the line at `path`. Error Unreachable: no such path, or the line is already locked. Call
  /// once.
  [[nodiscard]] Result<void> take(const std::string& path);

 private:
  int fd_ = -1;
};

}  // namespace abbe::drivers
