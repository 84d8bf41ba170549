#pragma once
/// Converts the daemon's data to the types of abbe_v1.idl. These functions copy values and evaluate
/// the model; they contain no other mathematics. Pure, thread-safe; allocates.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/model/offset_in_model.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/drivers/device.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/protocol/samples.hpp"
#include "abbe_v1.h"  // generated from protocol/idl/abbe_v1.idl

namespace abbe::daemon {

/// The active model, with the data that subscribers need.
struct PublishedModel {
  std::string id;
  std::string method;
  std::string estimator;
  /// SHA-256 of the recording of the identification; empty if it was not recorded.
  std::string recording_sha256;
  protocol::UtcTime created{};
  protocol::HostTime active_since{};
  std::string hash = {};  ///< model_hash() of the document
  /// The largest U(V), k = 2, of calib::iso::volume_error(); nullopt: it cannot be computed.
  std::optional<double> largest_U_m = {};
  bool simulated = false;  ///< true: simulated devices measured its data
  std::optional<calib::TrackerPlace> tracker_place = {};  ///< not published; needed for updates
  calib::VolumetricModel model;
};

/// Identifies the publishing machine, in addition to its name.
struct PublishedIdentity {
  std::string machine_id;  ///< UUID
  std::string twin_seen;   ///< another publisher that claims to be this machine; empty: none
  bool devices_simulated = false;  ///< [daemon] simulated
  friend bool operator==(const PublishedIdentity&, const PublishedIdentity&) = default;
};

/// Machine, sequence number and time of a message.
struct Stamp {
  std::string_view machine;
  std::uint64_t sequence_number = 0;
  protocol::HostTime now{};
};

[[nodiscard]] v1::Snapshot snapshot_message(const protocol::Snapshot&, protocol::UtcOffset,
                                            const Stamp&);
[[nodiscard]] v1::ErrorModel model_message(const PublishedModel&, const Stamp&);
/// The volumetric error V at the nodes of calib::interpolation_grid(), of which there are at most
/// 4096, in slices of the size that the IDL allows. If every_node is false, V and cov_m2 include
/// calib::interpolation_error(). For a model with backlash, V and cov_m2 are computed as in
/// compensation_message().
[[nodiscard]] std::vector<v1::ErrorGrid> grid_messages(const PublishedModel&, const Stamp&);
[[nodiscard]] v1::ModelState state_message(v1::ModelStatus, std::string_view reason,
                                           const PublishedModel*, std::chrono::nanoseconds validity,
                                           const Stamp&);
[[nodiscard]] v1::Identity identity_message(const PublishedIdentity&, const PublishedModel* active,
                                            const Stamp&);
/// The volumetric error V at the axis position of the live view, for the given tool. V is zero and
/// `inside` is false if there is no model, if the model is not valid for this tool, or if the axis
/// positions are not known. In the last case the message also has the status STALE instead of
/// ACTIVE. For a model with backlash, V is the mean of both directions of travel, whatever the axes
/// do, and cov_m2 includes half the difference and its uncertainty.
[[nodiscard]] v1::Compensation compensation_message(v1::ModelStatus, const PublishedModel*,
                                                    const protocol::Snapshot&,
                                                    const std::array<double, 3>& tool_offset_m,
                                                    std::chrono::nanoseconds validity,
                                                    const Stamp&);
[[nodiscard]] v1::Health health_message(const drivers::DeviceStatus&, double rate_hz,
                                        double latency_p50_s, double latency_p99_s, const Stamp&);
[[nodiscard]] v1::CalibrationEvent event_message(const SessionEvent&, std::string_view machine);

}  // namespace abbe::daemon
