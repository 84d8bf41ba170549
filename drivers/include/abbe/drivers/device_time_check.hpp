#pragma once
/// Judges the device time of each point of a stream before it reaches the clock model. One corrupt
/// time far ahead would make all later points appear too early; one far behind would restart the
/// clock model. So a time that does not fit is refused, and only if several times in a row agree
/// with each other has the device's clock jumped. Deterministic, fixed memory. One thread.

#include <chrono>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

class DeviceTimeCheck {
 public:
  enum class Verdict {
    Follows,  ///< later than the point before
    Refused,  ///< not later, or ahead; this point only
    Jumped,   ///< as the points before it that were refused: the clock has a new time base
  };

  /// Times in a row that agree before they are a new time base.
  static constexpr int kAgreeing = 3;
  /// Largest step between two times that agree.
  static constexpr std::chrono::seconds kLargestStep{10};

  /// `ahead`: by the clock model the point would have been measured after it arrived.
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
  int agreeing_ = 0;  ///< points in a row that agree with each other and not with the time base
  protocol::DeviceTime last_{};       ///< of the last point that was not refused
  protocol::DeviceTime candidate_{};  ///< of the last point that was refused
};

}  // namespace abbe::drivers
