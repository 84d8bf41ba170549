#pragma once
/// What a shop floor does to a driver (cable out, port taken, no permission), as a value. Ordinary
/// world only: the real-time path has counters and flags instead.

#include <string>
#include <tl/expected.hpp>

namespace abbe::drivers {

enum class ErrorCode {
  BadConfiguration,  ///< an option outside its range, an address that cannot be parsed
  SystemRefused,     ///< the operating system said no: permission, limit, missing interface
  Unreachable,       ///< nobody answers at that address
  Timeout,           ///< somebody is there and stays silent
  Protocol,          ///< the device says what it must not say
  DeviceRefused,     ///< the device understood and declined
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
