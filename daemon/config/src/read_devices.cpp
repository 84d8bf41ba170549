#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "abbe/config/unmeasured_air.hpp"
#include "abbe/drivers/tracker/order.hpp"
#include "axis_steps.hpp"
#include "machine_order.hpp"
#include "message_bounds.hpp"
#include "plausible.hpp"
#include "readers.hpp"

namespace abbe::daemon {

namespace {

void read_noise(Section& tracker, MachineConfig& machine) {
  tracker.get("sigma_range_um", machine.sigma_range_m, kMicro, kPositive);
  tracker.get("sigma_angle_urad", machine.sigma_angle_rad, kMicro, kPositive);
  tracker.get("u_range_offset_um", machine.u_range_offset_m, kMicro, kNotNegative);
}

void read_placement(Section& tracker, MachineConfig& machine) {
  TrackerVertical vertical = TrackerVertical::PlusZ;
  if (tracker.get_word<TrackerVertical>("vertical", vertical,
                                        {{"+X", TrackerVertical::PlusX},
                                         {"-X", TrackerVertical::MinusX},
                                         {"+Y", TrackerVertical::PlusY},
                                         {"-Y", TrackerVertical::MinusY},
                                         {"+Z", TrackerVertical::PlusZ},
                                         {"-Z", TrackerVertical::MinusZ}}))
    machine.tracker_vertical = vertical;
  std::vector<double> position_m;

  if (!tracker.get("position_mm", position_m, kMilli)) return;
  if (position_m.size() == 3)
    machine.tracker_position_m = {position_m[0], position_m[1], position_m[2]};
  else
    tracker.fault("position_mm", "must be three numbers, x, y, z in machine coordinates");
}

/// The measurement period of emScon is a whole number of milliseconds. Other rates are refused,
/// because the controller would change them silently.
void read_point_rate(Section& tracker, TrackerConfig& out) {
  constexpr double kRounded = 5e-3;  // relative; accepts 333 for 333.3
  if (!tracker.get("point_rate_hz", out.point_rate_hz, kPlain, {1.0, 1000.0})) return;
  const double period_ms = std::round(1e3 / out.point_rate_hz);
  if (std::abs(out.point_rate_hz * period_ms / 1e3 - 1.0) > kRounded)
    tracker.fault("point_rate_hz",
                  fmt::format("the period must be a whole number of ms: use {:.4g} or {:.4g}",
                              1e3 / std::ceil(1e3 / out.point_rate_hz),
                              1e3 / std::floor(1e3 / out.point_rate_hz)));
  out.point_rate_hz = 1e3 / period_ms;
}

/// Keys that apply only to the other mode are refused instead of being ignored silently.
void read_mode(Section& tracker, TrackerConfig& out) {
  constexpr int kLongest_ms = 60'000;  // emScon
  tracker.get_word<TrackerModeConfig>("mode", out.mode,
                                      {{"continuous", TrackerModeConfig::Continuous},
                                       {"stationary", TrackerModeConfig::Stationary}});

  if (out.mode == TrackerModeConfig::Stationary) {
    int time_ms = static_cast<int>(out.stationary_time / std::chrono::milliseconds{1});
    tracker.get_integer("stationary_time_ms", time_ms, 1, kLongest_ms);
    out.stationary_time = std::chrono::milliseconds{time_ms};
    if (tracker.has("point_rate_hz"))
      tracker.fault("point_rate_hz", "has no meaning with mode = \"stationary\"");
  } else {
    read_point_rate(tracker, out);
    if (tracker.has("stationary_time_ms"))
      tracker.fault("stationary_time_ms", "has no meaning with mode = \"continuous\"");
  }
}

void read_tracker_timeouts(Section& tracker, TrackerConfig& out) {
  tracker.get("max_constant_delay_us", out.max_constant_delay, kMicro, kNotNegative);
  tracker.get("connect_timeout_s", out.connect_timeout, kPlain, kPositive);
  tracker.get("command_timeout_s", out.command_timeout, kPlain, kPositive);
  tracker.get("initialize_timeout_s", out.initialize_timeout, kPlain, kPositive);
  tracker.get("silence_timeout_s", out.silence_timeout, kPlain, kPositive);
}

void read_search(Section& tracker, TrackerConfig& out) {
  constexpr Bounds kRadius_mm{0.1, 10e3}, kTimeout_s{0.1, 600.0};
  TrackerSearchConfig search;
  const bool radius = tracker.get("search_radius_mm", search.radius_m, kMilli, kRadius_mm);
  const bool timeout = tracker.get("search_timeout_s", search.timeout, kPlain, kTimeout_s);
  if (radius && timeout) out.search = search;

  const auto misses = [&](std::string_view given, std::string_view missing) {
    if (tracker.has(given) && !tracker.has(missing))
      tracker.fault(
          missing,
          fmt::format("missing, but {} is given: the controller takes both or none", given));
  };

  misses("search_radius_mm", "search_timeout_s");
  misses("search_timeout_s", "search_radius_mm");
}

/// The reflector, and how the tracker finds it.
void read_beam(Section& tracker, TrackerConfig& out) {
  tracker.get_maybe_empty("reflector", out.reflector);
  if (out.reflector.size() > drivers::kLongestReflectorName)
    tracker.fault("reflector",
                  fmt::format("must be at most {} bytes long, the limit of the controllers",
                              drivers::kLongestReflectorName));
  tracker.get("home_after_initialize", out.home_after_initialize);
  read_search(tracker, out);
}

/// Keys that apply only to the other transport are refused instead of being ignored silently.
void refuse(Section& encoder, std::initializer_list<std::string_view> keys,
            std::string_view transport) {
  for (const auto key : keys)
    if (encoder.has(key))
      encoder.fault(key, fmt::format("has no meaning with transport = \"{}\"", transport));
}

void read_transport(Section& encoder, EncoderConfig& out) {
  const bool known = encoder.get_word<EncoderTransport>(
      "transport", out.transport,
      {{"udp", EncoderTransport::Udp}, {"socketcan", EncoderTransport::SocketCan}}, Need::Required);

  if (!known) {
    for (const auto key : {"interface", "sync", "local_port", "peer_host", "peer_port"})
      static_cast<void>(encoder.has(key));
  } else if (out.transport == EncoderTransport::SocketCan) {
    encoder.get("interface", out.interface, Need::Required);
    encoder.get_word<SyncConfig>("sync", out.sync,
                                 {{"daemon", SyncConfig::Daemon},
                                  {"kernel", SyncConfig::Kernel},
                                  {"external", SyncConfig::External}});
    refuse(encoder, {"local_port", "peer_host", "peer_port"}, "socketcan");
  } else {
    encoder.get_integer("local_port", out.local_port, 0, 65535);
    get_host(encoder, "peer_host", out.peer_host, Need::Required);
    if (std::ranges::count(out.peer_host, ':') > 1)
      encoder.implausible(
          "peer_host",
          "is an IPv6 address, but CAN over UDP uses IPv4: give an IPv4 address or a name");
    encoder.get_integer("peer_port", out.peer_port, 1, 65535, Need::Required);
    encoder.get_word<SyncConfig>(
        "sync", out.sync, {{"daemon", SyncConfig::Daemon}, {"external", SyncConfig::External}});
    if (out.sync == SyncConfig::External && out.local_port == 0)
      encoder.fault(
          "local_port",
          "missing: with sync = \"external\" abbed sends nothing, so the peer needs a fixed port");
    refuse(encoder, {"interface"}, "udp");
  }
}

/// Position of the reading in the TPDO. With sync = "external" abbed sends no SDO request to the
/// node, so the configuration must give it.
void read_mapping(Section& section, SyncConfig sync, EncoderNodeConfig& node) {
  constexpr int kLastByte = 4;  // a TPDO has 8 bytes, the position has 4
  section.get_integer("tpdo", node.tpdo, 1, 2);
  if (node.kind == AxisKind::Rotary)
    section.get_integer("wrap_counts", node.wrap_counts, 2, std::int64_t{1} << 32);
  if (sync != SyncConfig::External) {
    if (section.has("position_byte"))
      section.fault("position_byte",
                    "only with sync = \"external\": otherwise it is read from the node");
    return;
  }
  section.get_integer("position_byte", node.position_byte, 0, kLastByte);
  if (node.kind == AxisKind::Rotary && node.wrap_counts == 0)
    section.fault("wrap_counts", "missing: with sync = \"external\" it is not read from the node");
}

EncoderNodeConfig read_node(Section& section, const MachineConfig& machine, SyncConfig sync) {
  EncoderNodeConfig node;
  const bool named = section.get("axis", node.axis, Need::Required);
  const AxisConfig* axis = machine.find_axis(node.axis);
  if (named && axis == nullptr && !machine.axes.empty())
    section.fault("axis", "no such axis in [axes]");
  if (axis != nullptr) node.kind = axis->kind;
  section.get_integer("node", node.node, 1, 127, Need::Required);
  const bool linear = node.kind == AxisKind::Linear;
  section.get(linear ? "step_nm" : "step_nrad", node.step, kNano, kPositive);
  check_step(section, node.step, linear);
  section.get(linear ? "offset_mm" : "offset_rad", node.offset, linear ? kMilli : kPlain, kAny);
  bool invert = false;
  if (section.get("invert", invert) && invert) node.step = -node.step;
  read_mapping(section, sync, node);
  section.close();

  return node;
}

void read_nodes(Section& encoder, const MachineConfig& machine, EncoderConfig& out) {
  constexpr std::size_t kMostNodes = 8;  // maximum number of axes in a sample
  std::set<std::string> axes;
  std::set<int> ids;

  for (auto& section : encoder.children("nodes")) {
    auto node = read_node(section, machine, out.sync);
    if (!node.axis.empty() && !axes.insert(node.axis).second)
      section.fault("axis", fmt::format("axis {} has two nodes", node.axis));
    if (node.node != 0 && !ids.insert(node.node).second)
      section.fault("node", fmt::format("node id {} is used twice", node.node));
    out.nodes.push_back(std::move(node));
  }

  if (out.nodes.empty() || out.nodes.size() > kMostNodes)
    encoder.fault("nodes", fmt::format("needs 1 to {} nodes", kMostNodes));
  put_in_order_of_the_machine(machine, &EncoderNodeConfig::axis, encoder, "nodes", "node",
                              out.nodes);
}

}  // namespace

namespace {

/// `air`: the table [air], which is read after [tracker]; null if absent.
double default_u_scale(WeatherConfig weather, const toml::node* air) {
  if (weather == WeatherConfig::Compute) return TrackerConfig::kControllersAir;
  const bool corrected =
      air != nullptr && air->is_table() && air->as_table()->contains("assumed_index");
  return corrected ? 0.0 : u_of_unmeasured_air();
}

}  // namespace

void read_tracker(Section& root, Config& out, StreamNames& names) {
  Section tracker = root.child("tracker");
  read_noise(tracker, out.machine);
  read_placement(tracker, out.machine);
  TrackerConfig config;
  const bool has_host = get_host(tracker, "host", config.host);
  get_bounded(tracker, "name", config.name, bound_of<v1::TrackerPoint>("device"));
  tracker.get_integer("port", config.port, 1, 65535);
  read_mode(tracker, config);
  tracker.get_word<WeatherConfig>("weather", config.weather,
                                  {{"none", WeatherConfig::None},
                                   {"read", WeatherConfig::Read},
                                   {"compute", WeatherConfig::Compute}});

  if (!tracker.get("u_scale_ppm", config.u_scale, kMicro, kNotNegative))
    config.u_scale = default_u_scale(config.weather, root.node("air"));
  read_tracker_timeouts(tracker, config);
  read_beam(tracker, config);
  if (!has_host && tracker.has("port") && !tracker.has("host"))
    tracker.fault("host", "missing, but a port is given");
  tracker.close();
  if (!has_host) return;
  names.take(config.name, tracker);
  out.tracker = std::move(config);
}

void read_encoder(Section& root, Config& out, StreamNames& names) {
  Section encoder = root.child("encoder");
  if (!encoder.present()) return;
  EncoderConfig config;
  get_bounded(encoder, "name", config.name, bound_of<v1::AxisSample>("device"));
  read_transport(encoder, config);

  // Shorter than the 350 ms after which a node counts as silent, and the 500 ms after which an axis
  // counts as unknown.
  encoder.get("sync_period_us", config.sync_period, kMicro, {100.0, 100e3});
  encoder.get("sampling_delay_us", config.sampling_delay, kMicro, kNotNegative);
  encoder.get("u_sampling_delay_us", config.u_sampling_delay, kMicro, kNotNegative);
  if (config.u_sampling_delay.count() == 0 && !out.daemon.simulated)
    encoder.fault("u_sampling_delay_us",
                  "must be positive: the latch time of a real node is never known exactly");
  encoder.get("axes_compensated", config.axes_compensated);
  read_nodes(encoder, out.machine, config);
  encoder.close();
  names.take(config.name, encoder);
  out.encoder = std::move(config);
}

}  // namespace abbe::daemon
