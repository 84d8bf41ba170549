#pragma once
/// Lowest and highest temperature of a run, for the report. Not for the RT path; not thread-safe.

#include <array>
#include <optional>

#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

class TemperatureRange {
 public:
  /// Adds the temperatures that are known at this instant: of the air and of all sensors.
  void take(const protocol::Snapshot& snapshot);
  /// Lowest and highest temperature; nullopt: no temperature was known.
  [[nodiscard]] const std::optional<std::array<double, 2>>& range_K() const { return range_K_; }

 private:
  void add(double temperature_K);
  std::optional<std::array<double, 2>> range_K_;
};

}  // namespace abbe::daemon
