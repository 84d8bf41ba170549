#pragma once
/// What the daemon knows, as the types of abbe_v1.idl. Copying and naming only: no mathematics
/// beyond asking the model. Pure, thread-safe; allocates.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/volumetric_model.hpp"
#include "abbe/drivers/device.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/protocol/samples.hpp"
#include "abbe_v1.h"  // generated from protocol/idl/abbe_v1.idl

namespace abbe::daemon {

/// The model in force with what subscribers must know of it.
struct ModelInForce {
  std::string id;
  std::string method;
  std::string estimator;
  std::string
      recording_sha256;  ///< of what was recorded when it was identified; empty: not recorded
  protocol::UtcTime created{};
  protocol::HostTime active_since{};
  calib::VolumetricModel model;
};

/// How a publication is stamped.
struct Stamp {
  std::string_view machine;
  std::uint64_t sequence_number = 0;
  protocol::HostTime now{};
};

[[nodiscard]] v1::Snapshot snapshot_message(const protocol::Snapshot&, protocol::UtcOffset,
                                            const Stamp&);
[[nodiscard]] v1::ErrorModel model_message(const ModelInForce&, const Stamp&);
/// V on calib::interpolation_grid() of 4096 nodes, in slices of the IDL's bound. cov_m2 includes
/// what linear interpolation misses where every_node is false.
[[nodiscard]] std::vector<v1::ErrorGrid> grid_messages(const ModelInForce&, const Stamp&);
[[nodiscard]] v1::ModelState state_message(v1::ModelStatus, std::string_view reason,
                                           const ModelInForce*, std::chrono::nanoseconds validity,
                                           const Stamp&);
/// V at the axis position of the live view, for the given tool; all zero and not inside without a
/// model, for a tool it does not hold for, and where the axes are not known: ACTIVE becomes STALE
/// then, in this very message.
[[nodiscard]] v1::Compensation compensation_message(v1::ModelStatus, const ModelInForce*,
                                                    const protocol::Snapshot&,
                                                    const std::array<double, 3>& tool_offset_m,
                                                    std::chrono::nanoseconds validity,
                                                    const Stamp&);
[[nodiscard]] v1::Health health_message(const drivers::DeviceStatus&, double rate_hz,
                                        double latency_p50_s, double latency_p99_s, const Stamp&);
[[nodiscard]] v1::CalibrationEvent event_message(const SessionEvent&, std::string_view machine);

}  // namespace abbe::daemon
