#include "abbe/drivers/lines/contents.hpp"

#include <cmath>

namespace abbe::drivers {

using protocol::SampleFlag;

void LinePoints::fill(const Line& line, const Format& /*format*/, std::uint32_t /*number*/,
                      Sample& sample) ABBE_RT {
  sample.p_tracker_m = line.p_tracker_m;
  sample.device_status = line.status;
  sample.device_time = line.time.value_or(protocol::DeviceTime{});
  if (!line.valid) sample.head.flags |= SampleFlag::PointInvalid;
}

void LineAxes::fill(const Line& line, const Format& format, std::uint32_t number,
                    Sample& sample) ABBE_RT {
  sample.cycle = number;
  sample.axis_count = static_cast<std::uint8_t>(format.value_count);

  for (std::size_t i = 0; i < format.value_count; ++i) {
    const bool known = !std::isnan(line.value[i]);
    if (!known || !line.valid)
      sample.missing_mask = static_cast<std::uint8_t>(sample.missing_mask | (1u << i));
    if (!known) continue;
    sample.position[i] = line.value[i];
    sample.count[i] = std::llround(line.value[i] / kCount);
  }

  if (sample.missing_mask != 0) sample.head.flags |= SampleFlag::AxisMissing;
}

}  // namespace abbe::drivers
