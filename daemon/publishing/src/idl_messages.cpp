#include "abbe/publishing/idl_messages.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "abbe/calib/model/interpolation_grid.hpp"
#include "abbe/pipeline/live_view.hpp"

namespace abbe::daemon {
namespace {

using std::chrono::nanoseconds;

constexpr std::size_t kNodesPerSlice = 456;   // ErrorGrid::nodes in the IDL
constexpr std::size_t kMostGridNodes = 4096;  // 9 slices: the number a late joiner receives at once
constexpr std::size_t kHullBound = 512;       // ErrorModel::validity_hull
constexpr std::size_t kReasonBound = 256;  // ModelState::reason, Health::fault, Identity::twin_seen
constexpr std::size_t kEventReasonBound = 512;

std::int64_t ns(protocol::HostTime t) {
  return t.time_since_epoch().count();
}

/// The text, truncated to at most `bound` bytes between two UTF-8 characters.
std::string cut(std::string_view text, std::size_t bound) {
  constexpr unsigned kContinuationMask = 0xC0, kContinuation = 0x80;
  if (text.size() > bound)
    while (bound > 0 &&
           (static_cast<unsigned char>(text[bound]) & kContinuationMask) == kContinuation)
      --bound;
  return std::string{text.substr(0, bound)};
}

std::array<double, 3> array(const calib::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

std::array<double, 6> upper_triangle(const calib::Matrix3& c) {
  return {c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)};
}

/// The vertices of the validity hull, or at most kHullBound of them, evenly spread. The hull of
/// these vertices is inside the true one and only slightly smaller on every side.
std::vector<v1::HullVertex> hull_of(const calib::ValidityVolume& validity) {
  std::vector<v1::HullVertex> hull;
  for (const calib::Vector3& p : calib::spread_subset(validity.vertices_m(), kHullBound))
    hull.emplace_back().position_m(array(p));
  return hull;
}

/// V as the mean of both directions of travel. The gate and the held-out legs test the mean; a
/// vector that steps when the direction reverses could move the axis back, and then step again.
calib::VolumetricError error_in_either_direction(const calib::VolumetricModel& model,
                                                 const calib::Vector3& q_m,
                                                 const calib::Vector3& tool_m) {
  constexpr calib::AxisTravel kUnknown{};
  return model.error_at(q_m, tool_m, kUnknown);
}

v1::GridNode grid_node(const PublishedModel& m, const calib::InterpolationGrid& grid,
                       const std::array<std::size_t, 3>& at, const calib::Vector3& tool_m) {
  const calib::Vector3 q_m(grid.axes_m[0][at[0]], grid.axes_m[1][at[1]], grid.axes_m[2][at[2]]);
  const auto e = error_in_either_direction(m.model, q_m, tool_m);
  const auto missed = calib::interpolation_error(m.model, grid, at);
  v1::GridNode node;
  node.position_m(array(q_m));
  node.error_m(array(e.V_m + missed.mean_m));
  node.cov_m2(upper_triangle(e.cov_V_m2 + missed.moment_m2));
  node.inside(e.inside);
  return node;
}

}  // namespace

v1::Snapshot snapshot_message(const protocol::Snapshot& s, protocol::UtcOffset utc,
                              const Stamp& stamp) {
  v1::Snapshot m;
  m.machine(std::string{stamp.machine});
  m.sequence_number(stamp.sequence_number);
  m.host_time_ns(ns(s.head.time));
  m.utc_offset_ns(utc.value.count());
  m.u_time_ns(s.head.u_time.count());
  m.flags(s.head.flags);
  m.missing_mask(s.missing_mask);
  m.axes_compensated(s.axes_compensated);
  const auto n = static_cast<std::ptrdiff_t>(s.axis_count);
  m.position(std::vector<double>(s.position.begin(), s.position.begin() + n));
  m.velocity(std::vector<double>(s.velocity.begin(), s.velocity.begin() + n));
  m.u_position(std::vector<double>(s.u_position.begin(), s.u_position.begin() + n));
  m.has_tracker_point(s.has_tracker_point);
  m.p_tracker_m(s.tracker_point.p_tracker_m);
  m.tracker_device_time_ns(s.tracker_point.device_time.time_since_epoch().count());
  m.has_trigger(s.has_trigger);
  m.touch(s.trigger.touch);
  m.has_environment(s.has_environment);
  m.air_temperature_K(s.environment.air_temperature_K);
  m.air_pressure_Pa(s.environment.air_pressure_Pa);
  m.relative_humidity(s.environment.relative_humidity);

  return m;
}

v1::ErrorModel model_message(const PublishedModel& active, const Stamp& stamp) {
  v1::ErrorModel m;
  m.machine(std::string{stamp.machine});
  m.sequence_number(stamp.sequence_number);
  m.model_id(active.id);
  m.method(active.method);
  m.estimator(active.estimator);
  m.gauge(std::string{calib::name(active.model.datum())});
  m.chain(active.model.chain().text());
  const auto interpolation = active.model.interpolation();
  m.basis(interpolation ? std::string{calib::name(*interpolation)} : "legendre");
  m.squareness("travel");
  m.tool_offset_m(array(active.model.tool_offsets_m().front()));

  for (const auto& p : active.model.parameters()) {
    v1::Parameter q;
    q.name(p.name);
    q.position_m(p.position_m.value_or(0.0));
    q.value(p.value);
    q.u(p.u);
    m.parameters().push_back(q);
  }

  for (const calib::Axis a : calib::kAllAxes) {
    const auto& nodes_m = active.model.nodes()[calib::index(a)].nodes_m;
    v1::AxisRange range;
    range.axis(std::string{calib::letter(a)});
    range.min_m(nodes_m.front());
    range.max_m(nodes_m.back());
    m.validity().push_back(range);
  }

  m.validity_hull(hull_of(active.model.validity()));
  m.recording_sha256(active.recording_sha256);
  m.created_utc_ns(active.created.time_since_epoch().count());

  return m;
}

std::vector<v1::ErrorGrid> grid_messages(const PublishedModel& active, const Stamp& stamp) {
  const auto grid = calib::interpolation_grid(active.model, kMostGridNodes);
  const calib::Vector3 tool_m = active.model.tool_offsets_m().front();
  std::vector<v1::GridNode> all;

  for (std::size_t x = 0; x < grid.axes_m[0].size(); ++x) {
    for (std::size_t y = 0; y < grid.axes_m[1].size(); ++y) {
      for (std::size_t z = 0; z < grid.axes_m[2].size(); ++z)
        all.push_back(grid_node(active, grid, {x, y, z}, tool_m));
    }
  }

  const std::size_t slices = (all.size() + kNodesPerSlice - 1) / kNodesPerSlice;
  std::vector<v1::ErrorGrid> messages;
  for (std::size_t slice = 0; slice < slices; ++slice) {
    const auto begin = all.begin() + static_cast<std::ptrdiff_t>(slice * kNodesPerSlice);
    const auto left = static_cast<std::size_t>(all.end() - begin);
    v1::ErrorGrid m;
    m.machine(std::string{stamp.machine});
    m.slice(static_cast<std::uint32_t>(slice));
    m.slices(static_cast<std::uint32_t>(slices));
    m.sequence_number(stamp.sequence_number);
    m.model_id(active.id);
    m.tool_offset_m(array(tool_m));
    m.every_node(grid.every_node);
    m.nodes(std::vector<v1::GridNode>(
        begin, begin + static_cast<std::ptrdiff_t>(std::min(left, kNodesPerSlice))));
    messages.push_back(std::move(m));
  }

  return messages;
}

v1::ModelState state_message(v1::ModelStatus status, std::string_view reason,
                             const PublishedModel* active, nanoseconds validity,
                             const Stamp& stamp) {
  v1::ModelState m;
  m.machine(std::string{stamp.machine});
  m.sequence_number(stamp.sequence_number);
  m.host_time_ns(ns(stamp.now));
  m.state(status);
  m.reason(cut(reason, kReasonBound));
  if (active != nullptr) {
    m.model_id(active->id);
    m.age_ns((stamp.now - active->active_since).count());
  }
  m.validity_ns(validity.count());
  return m;
}

v1::Identity identity_message(const PublishedIdentity& identity, const PublishedModel* active,
                              const Stamp& stamp) {
  v1::Identity m;
  m.machine(std::string{stamp.machine});
  m.sequence_number(stamp.sequence_number);
  m.host_time_ns(ns(stamp.now));
  m.machine_id(identity.machine_id);
  m.twin(!identity.twin_seen.empty());
  m.twin_seen(cut(identity.twin_seen, kReasonBound));
  if (active != nullptr) {
    m.model_id(active->id);
    m.model_simulated(active->simulated);
  }
  m.devices_simulated(identity.devices_simulated);
  return m;
}

v1::Compensation compensation_message(v1::ModelStatus status, const PublishedModel* active,
                                      const protocol::Snapshot& s,
                                      const std::array<double, 3>& tool_offset_m,
                                      nanoseconds validity, const Stamp& stamp) {
  v1::Compensation m;
  m.machine(std::string{stamp.machine});
  m.sequence_number(stamp.sequence_number);
  m.host_time_ns(ns(s.head.time));
  m.kind(v1::Quantity::QUANTITY_ERROR);
  const bool known = axes_known(s);
  const bool in_use =
      status == v1::ModelStatus::MODEL_ACTIVE || status == v1::ModelStatus::MODEL_DRIFT;
  m.state(in_use && !known ? v1::ModelStatus::MODEL_STALE : status);
  m.position_m({s.position[0], s.position[1], s.position[2]});
  m.tool_offset_m(tool_offset_m);

  // The age is that of the axis position to which this vector belongs; subscribers compare it with
  // validity_ns.
  m.age_ns((stamp.now - s.head.time).count());
  m.validity_ns(validity.count());
  if (active == nullptr) return m;
  m.model_id(active->id);
  if (!known) return m;  // a vector for an old position must not be published as valid
  const auto e =
      error_in_either_direction(active->model, {s.position[0], s.position[1], s.position[2]},
                                {tool_offset_m[0], tool_offset_m[1], tool_offset_m[2]});
  m.tool_ok(e.tool_ok);
  if (!e.tool_ok) return m;  // the vector stays zero
  m.inside(e.inside);
  m.vector_m(array(e.V_m));
  m.cov_m2(upper_triangle(e.cov_V_m2));

  return m;
}

namespace {

/// The present condition, then the last fault.
std::string fault_text(const drivers::DeviceStatus& d) {
  if (d.condition.empty() || d.last_fault.empty() || d.condition == d.last_fault)
    return d.condition.empty() ? d.last_fault : d.condition;
  return d.condition + "; last fault: " + d.last_fault;
}

}  // namespace

v1::Health health_message(const drivers::DeviceStatus& d, double rate_hz, double latency_p50_s,
                          double latency_p99_s, const Stamp& stamp) {
  v1::Health m;
  m.machine(std::string{stamp.machine});
  m.stream(d.name);
  m.sequence_number(stamp.sequence_number);
  m.host_time_ns(ns(stamp.now));
  m.state(std::string{d.state});
  m.rate_hz(rate_hz);
  m.samples(d.samples);
  m.dropped(d.dropped + d.raw_dropped);
  m.gaps(d.gaps);
  m.clock_residual_s(std::chrono::duration<double>(d.clock.residual).count());
  m.latency_p50_s(latency_p50_s);
  m.latency_p99_s(latency_p99_s);
  m.fault(cut(fault_text(d), kReasonBound));

  return m;
}

v1::CalibrationEvent event_message(const SessionEvent& event, std::string_view machine) {
  v1::CalibrationEvent m;
  m.machine(std::string{machine});
  m.host_time_ns(ns(event.time));
  m.method(event.status.method);
  m.state(std::string{name(event.status.state)});
  m.reason(cut(event.status.reason, kEventReasonBound));
  m.progress(event.status.progress);
  m.model_id(event.status.model_id);
  return m;
}

}  // namespace abbe::daemon
