#pragma once
/// Checks the device time of each point of a stream before the clock model uses it. One corrupt
/// time far ahead would make all later points appear too early; one far behind would restart the
/// clock model. A time that does not fit is therefore refused. If several such times in a row agree
/// with each other, the device's clock has jumped. Deterministic, fixed memory. One thread.

#include <chrono>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

class DeviceTimeCheck {
 public:
  enum class Verdict {
    Follows,  ///< the time is later than that of the point before
    Refused,  ///< the time is not later, or ahead of the arrival; only this point is refused
    /// the time agrees with those of the points refused before it: the clock has a new time base
    Jumped,
  };

  /// Number of refused times in a row that must agree with each other to become the new time base.
  static constexpr int kAgreeing = 3;
  /// Largest difference of two successive times that agree.
  static constexpr std::chrono::seconds kLargestStep{10};

  /// `ahead`: according to the clock model the point would have been measured after it arrived.
  Verdict judge(protocol::DeviceTime t, bool ahead) ABBE_RT {
    if (!known_ || (t > last_ && !ahead)) {
      known_ = true;
      last_ = t;
      agreeing_ = 0;
      return Verdict::Follows;
    }
    const bool agrees = agreeing_ > 0 && t > candidate_ && t - candidate_ <= kLargestStep;
    agreeing_ = agrees ? agreeing_ + 1 : 1;
    candidate_ = t;
    if (agreeing_ < kAgreeing) return Verdict::Refused;
    last_ = t;
    agreeing_ = 0;
    return Verdict::Jumped;
  }

  [[nodiscard]] bool known() const ABBE_RT { return known_; }
  [[nodiscard]] protocol::DeviceTime last() const ABBE_RT { return last_; }
  void reset() ABBE_RT { *this = {}; }

 private:
  bool known_ = false;
  int agreeing_ = 0;                  ///< refused points in a row whose times agree with each other
  protocol::DeviceTime last_{};       ///< time of the last point that was not refused
  protocol::DeviceTime candidate_{};  ///< time of the last point that was refused
};

}  // namespace abbe::drivers
