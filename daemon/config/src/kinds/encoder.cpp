#include "abbe/config/kinds/encoder.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "axis_steps.hpp"
#include "classified_section.hpp"
#include "config_kind.hpp"
#include "machine_order.hpp"
#include "message_bounds.hpp"
#include "plausible.hpp"

namespace abbe::daemon {

namespace {

/// Adds a fault for each of `keys`, which apply only to the other transport: ignoring them silently
/// would hide a mistake.
void refuse_encoder_keys(ClassifiedSection& encoder, std::initializer_list<std::string_view> keys,
                         std::string_view transport) {
  for (const auto key : keys)
    if (encoder.has(key))
      encoder.fault(key, fmt::format("has no meaning with transport = \"{}\"", transport));
}

void read_encoder_transport(ClassifiedSection& encoder, EncoderConfig& out) {
  const bool known = encoder.get_word<EncoderTransport>(
      operation("transport"), out.transport,
      {{"udp", EncoderTransport::Udp}, {"socketcan", EncoderTransport::SocketCan}}, Need::Required);

  if (!known) {
    for (const auto key : {"interface", "sync", "local_port", "peer_host", "peer_port"})
      static_cast<void>(encoder.has(key));
  } else if (out.transport == EncoderTransport::SocketCan) {
    encoder.get(operation("interface"), out.interface, Need::Required);
    encoder.get_word<SyncConfig>(operation("sync"), out.sync,
                                 {{"daemon", SyncConfig::Daemon},
                                  {"kernel", SyncConfig::Kernel},
                                  {"external", SyncConfig::External}});
    refuse_encoder_keys(encoder, {"local_port", "peer_host", "peer_port"}, "socketcan");
  } else {
    encoder.get_integer(operation("local_port"), out.local_port, 0, 65535);
    get_host(encoder, operation("peer_host"), out.peer_host, Need::Required);
    if (std::ranges::count(out.peer_host, ':') > 1)
      encoder.implausible(
          "peer_host",
          "is an IPv6 address, but CAN over UDP uses IPv4: give an IPv4 address or a name");
    encoder.get_integer(operation("peer_port"), out.peer_port, 1, 65535, Need::Required);
    encoder.get_word<SyncConfig>(
        operation("sync"), out.sync,
        {{"daemon", SyncConfig::Daemon}, {"external", SyncConfig::External}});
    if (out.sync == SyncConfig::External && out.local_port == 0)
      encoder.fault(
          "local_port",
          "missing: with sync = \"external\" abbed sends nothing, so the peer needs a fixed port");
    refuse_encoder_keys(encoder, {"interface"}, "udp");
  }
}

/// Reads the position of the axis value in the TPDO. With sync = "external" abbed sends no SDO
/// request to the node to find this position, so the configuration must state it.
void read_mapping(ClassifiedSection& section, SyncConfig sync, EncoderNodeConfig& node) {
  constexpr int kLastByte = 4;  // a TPDO has 8 bytes, the position has 4
  section.get_integer(reading("tpdo"), node.tpdo, 1, 2);
  if (node.kind == AxisKind::Rotary)
    section.get_integer(reading("wrap_counts"), node.wrap_counts, 2, std::int64_t{1} << 32);
  if (sync != SyncConfig::External) {
    if (section.has("position_byte"))
      section.fault("position_byte",
                    "only with sync = \"external\": otherwise it is read from the node");
    return;
  }
  section.get_integer(reading("position_byte"), node.position_byte, 0, kLastByte);
  if (node.kind == AxisKind::Rotary && node.wrap_counts == 0)
    section.fault("wrap_counts", "missing: with sync = \"external\" it is not read from the node");
}

EncoderNodeConfig read_node(ClassifiedSection& section, const MachineConfig& machine,
                            SyncConfig sync) {
  EncoderNodeConfig node;
  const bool named = section.get(stated("axis"), node.axis, Need::Required);
  const AxisConfig* axis = machine.find_axis(node.axis);
  if (named && axis == nullptr && !machine.axes.empty())
    section.fault("axis", "no such axis in [axes]");
  if (axis != nullptr) {
    node.kind = axis->kind;
    node.middle = 0.5 * (axis->min + axis->max);
  }
  section.get_integer(reading("node"), node.node, 1, 127, Need::Required);
  const bool linear = node.kind == AxisKind::Linear;
  section.get(reading(linear ? "step_nm" : "step_nrad"), node.step, kNano, kPositive);
  if (!linear && !section.has("step_nrad")) section.implausible("step_nrad", "missing");
  check_step(section, node.step, linear);
  section.get(reading(linear ? "offset_mm" : "offset_rad"), node.offset, linear ? kMilli : kPlain,
              kAny);
  bool invert = false;
  if (section.get(reading("invert"), invert) && invert) node.step = -node.step;
  read_mapping(section, sync, node);
  section.close();

  return node;
}

void read_nodes(ClassifiedSection& encoder, const MachineConfig& machine, EncoderConfig& out) {
  constexpr std::size_t kMostNodes = 8;  // maximum number of axes in a sample
  std::set<std::string> axes;
  std::set<int> ids;

  for (auto& section : encoder.children("nodes", "axis")) {
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

void read_encoder(ClassifiedSection& root, Config& out, StreamNames& names) {
  ClassifiedSection encoder = root.child("encoder");
  if (!encoder.present()) return;
  EncoderConfig config;
  get_bounded(encoder, operation("name"), config.name, bound_of<v1::AxisSample>("device"));
  read_encoder_transport(encoder, config);

  // The longest sync_period is shorter than the 350 ms after which a node counts as silent and the
  // 500 ms after which an axis position counts as unknown.
  encoder.get(operation("sync_period_us"), config.sync_period, kMicro, {100.0, 100e3});
  encoder.get(reading("sampling_delay_us"), config.sampling_delay, kMicro, kNotNegative);
  encoder.get(operation("u_sampling_delay_us"), config.u_sampling_delay, kMicro, kNotNegative);
  if (config.u_sampling_delay.count() == 0 && !out.daemon.simulated)
    encoder.fault("u_sampling_delay_us",
                  "must be positive: the latch time of a real node is never known exactly");
  encoder.get(reading("axes_compensated"), config.axes_compensated);
  read_nodes(encoder, out.machine, config);
  encoder.close();
  names.take(config.name, encoder);
  out.of<EncoderConfig>() = std::move(config);
}

void doubt_encoder(Section& root, const Config& config) {
  doubt_steps(root, "encoder", "nodes", config.machine);
}

std::vector<std::string> encoder_summary(const Config& config) {
  const auto& encoder = config.of<EncoderConfig>();
  if (!encoder) return {};
  std::vector<std::string> nodes;
  for (const auto& node : encoder->nodes)
    nodes.push_back(fmt::format("{} node {} step {}", node.axis, node.node,
                                step_text(node.step, node.kind == AxisKind::Linear)));
  const auto address = encoder->transport == EncoderTransport::SocketCan
                           ? encoder->interface
                           : fmt::format("{}:{} (UDP)", encoder->peer_host, encoder->peer_port);
  return {fmt::format("{}, {}", address, fmt::join(nodes, "; "))};
}

std::string former_encoder_text(const Config& config) {
  const auto& encoder = config.of<EncoderConfig>();
  if (!encoder) return {};
  std::string text = encoder->axes_compensated ? "|compensated" : "|raw";
  for (const auto& node : encoder->nodes)
    text += fmt::format("|{} {} {:.17g} {:.17g}", node.axis, node.node, node.step, node.offset);
  return text;
}

std::optional<AxisReadings> encoder_axes(const Config& config) {
  const auto& encoder = config.of<EncoderConfig>();
  if (!encoder) return std::nullopt;
  AxisReadings readings{
      .key = EncoderConfig::kKind.key, .axes = {}, .compensated = encoder->axes_compensated};
  for (const auto& node : encoder->nodes) readings.axes.push_back(node.axis);
  return readings;
}

std::optional<std::chrono::nanoseconds> time_of_encoder_samples(const Config& config,
                                                                double periods) {
  const auto& encoder = config.of<EncoderConfig>();
  if (!encoder) return std::nullopt;
  const std::chrono::duration<double, std::nano> time = periods * encoder->sync_period;
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time);
}

}  // namespace

const ConfigKind EncoderConfig::kKind{.key = "encoder",
                                      .read = &read_encoder,
                                      .doubt = &doubt_encoder,
                                      .summary = &encoder_summary,
                                      .former_text = &former_encoder_text,
                                      .axes = &encoder_axes,
                                      .time_of_axis_samples = &time_of_encoder_samples};

}  // namespace abbe::daemon
