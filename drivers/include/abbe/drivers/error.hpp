#pragma once
/// Errors that a driver meets on the shop floor (cable unplugged, port in use, no permission), as
/// values. Not for the real-time path, which has counters and flags instead.

#include <string>
#include <tl/expected.hpp>

namespace abbe::drivers {

enum class ErrorCode {
  BadConfiguration,  ///< an option or value outside its range, an unreadable address
  SystemRefused,     ///< the operating system refused: permission, limit, missing interface
  Unreachable,       ///< no device answers at that address, or the connection is lost
  Timeout,           ///< a connection or an answer did not come in time
  Protocol,          ///< the device violates its protocol
  DeviceRefused,     ///< the device understood the request and refused it
};

/// `text` is "what was tried: what was seen", e.g. "tracker 10.0.0.7:700: no reply in 3 s (3
/// tries)".
struct Error {
  ErrorCode code = ErrorCode::SystemRefused;
  std::string text;
};

template <class T>
using Result = tl::expected<T, Error>;

}  // namespace abbe::drivers
