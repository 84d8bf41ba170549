#include "abbe/config/kinds/reference_card.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "classified_section.hpp"
#include "config_kind.hpp"
#include "message_bounds.hpp"
#include "usb_card.hpp"

namespace abbe::daemon {

namespace {

drivers::CounterAxis read_latched_axis(ClassifiedSection& section, const CountedAxes& live,
                                       AxisMarks& marks) {
  drivers::CounterAxis axis{.latch_on_index = true};
  const bool named = section.get(stated("axis"), axis.name, Need::Required);
  const auto counted = std::ranges::find(live.axes(), axis.name, &drivers::CounterAxis::name);
  if (named && counted == live.axes().end())
    section.fault("axis", fmt::format("is not counted by [{}]", live.key));

  if (counted != live.axes().end()) {
    axis.scale = counted->scale;
    if (counted->offset != 0.0)
      section.fault("axis", fmt::format("has an offset in [{}]; remove it, the marks of {} give it",
                                        live.key, axis.name));
  }

  section.get_integer(reading("channel"), axis.channel, 0, kLastChannel, Need::Required);
  read_debounce(section, operation("debounce_code"), axis.debounce);
  marks.axis = axis.name;

  return axis;
}

void read_marks(ClassifiedSection& section, bool linear, double step, std::string_view counted_by,
                AxisMarks& out) {
  double length = 0.0;
  section.get(reading(linear ? "signal_period_um" : "signal_period_urad"), out.signal_period,
              kMicro, kPositive, Need::Required);
  section.get(reading(linear ? "length_mm" : "length_rad"), length, linear ? kMilli : kPlain,
              kPositive, Need::Required);
  section.get_integer(reading("increment"), out.code.increment, 2, 1'000'000);
  section.get(reading(linear ? "zero_mark_mm" : "zero_mark_rad"), out.zero_mark,
              linear ? kMilli : kPlain, kAny);
  section.get(reading("reversed"), out.reversed);
  out.code.rotary = !linear;
  out.code.length = std::llround(length / out.signal_period);
  const double counts = out.signal_period / std::abs(step);

  if (std::isfinite(counts) && std::abs(counts - std::round(counts)) > 1e-6 * counts)
    section.fault(
        "", fmt::format("a signal period holds {:.6g} counts of [{}]: it must be a whole number",
                        counts, counted_by));
  if (const auto possible = drivers::check(out.code); !possible)
    section.fault("", possible.error().text);
}

void read_latched_axes(ClassifiedSection& table, const CountedAxes& live,
                       const MachineConfig& machine, ReferenceConfig& out) {
  for (auto& section : table.children("axes", "axis")) {
    AxisMarks marks;
    out.card.wiring.axes.push_back(read_latched_axis(section, live, marks));
    const AxisConfig* known = machine.find_axis(marks.axis);
    const bool linear = known == nullptr || known->kind == AxisKind::Linear;
    read_marks(section, linear, out.card.wiring.axes.back().scale, live.key, marks);
    section.close();
    out.marks.axes.push_back(std::move(marks));
  }
}

/// True if two tables name the same card: one card cannot both count continuously and latch at
/// marks.
bool same_card(const UsbCardConfig& a, const UsbCardConfig& b) {
  if (a.transport != b.transport) return false;
  if (a.transport == CardTransport::Usb)
    return a.serial_number.empty() || a.serial_number == b.serial_number;
  return a.host == b.host && a.port == b.port && a.bus_id == b.bus_id;
}

void read_reference(ClassifiedSection& root, Config& out, StreamNames& names) {
  ClassifiedSection table = root.child("reference");
  if (!table.present()) return;
  ReferenceConfig config;
  UsbCardConfig& card = config.card;
  card.wiring.scan_rate_hz = 2000.0;
  get_bounded(table, operation("name"), card.name, bound_of<v1::AxisSample>("device"));
  table.get(operation("serial_number"), card.serial_number);
  read_card_address(table, card);
  read_card_clock(table, card.wiring);
  table.get(operation("scan_rate_hz"), card.wiring.scan_rate_hz, kPlain, kPositive);
  table.get(operation("max_constant_delay_us"), card.max_constant_delay, kMicro, kNotNegative);
  table.get(operation("latch_verified"), card.wiring.latch_verified);
  table.get(operation("u_alignment_us"), config.marks.u_alignment, kMicro, kPositive);
  table.get(operation("tolerance_um"), config.marks.tolerance_m, kMicro, kPositive);

  if (const auto live = counted_axes(out); !live) {
    table.fault("", fmt::format("needs {}, which counts the same axes continuously",
                                tables_with(Capability::CountedAxes)));
    static_cast<void>(table.has("axes"));
  } else {
    if (same_card(live->card, card))
      table.fault("", fmt::format("is the card of [{}]: reference marks need a second card, "
                                  "selected by its serial_number",
                                  live->key));
    read_latched_axes(table, *live, out.machine, config);
    if (const auto possible = drivers::check(card.wiring); !possible)
      table.fault("", possible.error().text);
  }

  table.close();
  names.take(card.name, table);
  out.of<ReferenceConfig>() = std::move(config);
}

std::vector<std::string> reference_summary(const Config& config) {
  const auto& reference = config.of<ReferenceConfig>();
  if (!reference) return {};
  return {card_text(reference->card, config.machine)};
}

std::string former_reference_text(const Config& config) {
  const auto& reference = config.of<ReferenceConfig>();
  if (!reference) return {};
  std::string text;
  for (const auto& axis : reference->marks.axes)
    text +=
        fmt::format("|marks {} {:.17g} {:.17g} {} {}", axis.axis, axis.zero_mark,
                    axis.signal_period, axis.code.increment, axis.reversed ? "reversed" : "along");
  return text;
}

const ReferenceMarks* marks_of_reference(const Config& config) {
  const auto& reference = config.of<ReferenceConfig>();
  return reference ? &reference->marks : nullptr;
}

}  // namespace

const ConfigKind ReferenceConfig::kKind{.key = "reference",
                                        .read = &read_reference,
                                        .summary = &reference_summary,
                                        .former_text = &former_reference_text,
                                        .marks = &marks_of_reference};

}  // namespace abbe::daemon
