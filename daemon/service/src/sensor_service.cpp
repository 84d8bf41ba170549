#include "abbe/service/sensor_service.hpp"

#include <fmt/format.h>

namespace abbe::daemon {

Result<void> SensorService::accept(const LiveView& live, SensorAcceptance acceptance,
                                   bool acquiring) {
  if (acceptance.why.empty())
    return fail(ErrorCode::Usage, "sensors accept: give the reason, which is recorded (--why)");
  if (const auto can = live.sensors().check_acceptance(acceptance.sensor); !can)
    return fail(can.error().code, fmt::format("sensors accept: {}", can.error().text));
  if (acquiring)
    return fail(ErrorCode::Refused,
                "sensors accept: a calibration takes readings: wait until it has ended, or cancel "
                "it");
  if (recorder_ != nullptr) recorder_->attach(to_attachment(acceptance), acceptance.from);
  accepted_.push_back(std::move(acceptance));
  return {};
}

}  // namespace abbe::daemon
