#pragma once
/// A control that prints the scale readings of its axes as lines of text. Not thread-safe.
///
/// The noise is that of encoders with the same seed on nodes 1, 2, ... in the order of the axes.

#include <cstdint>
#include <string>
#include <vector>

#include "abbe/protocol/lines/value_line.hpp"
#include "abbe/sim/line_source.hpp"
#include "abbe/sim/measured_axis.hpp"

namespace abbe::sim {

struct LineAxesOptions {
  LineTimes times{.bursts = false};
  /// What is printed; value i is axis i.
  lines::ValueFormat format;
  std::vector<MeasuredAxis> axes;
  double noise = 5e-9;  ///< standard deviation of a reading, m or rad
};

class LineAxes final : public LineSource {
 public:
  /// Switched on at `now`. `machine` must outlive it.
  LineAxes(LineAxesOptions options, const VirtualMachine& machine, HostTime now);

 private:
  [[nodiscard]] std::string print(const Instant& instant) const override;

  LineAxesOptions options_;
  const VirtualMachine& machine_;
};

/// A line of values, with LF. NaN: the first word of the format for an unknown value, or "nan".
[[nodiscard]] std::string print_values(const lines::ValueFormat& format,
                                       const std::vector<double>& values, DeviceTime t, bool valid);

}  // namespace abbe::sim
