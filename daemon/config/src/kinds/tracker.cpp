#include "abbe/config/kinds/tracker.hpp"

#include <fmt/format.h>

#include <cmath>

#include "abbe/calib/otf/samples/nest_visits.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/config/unmeasured_air.hpp"
#include "abbe/drivers/tracker/order.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "classified_section.hpp"
#include "config_kind.hpp"
#include "message_bounds.hpp"
#include "plausible.hpp"
#include "read_lines.hpp"

namespace abbe::daemon {

namespace {

void read_noise(ClassifiedSection& tracker, MachineConfig& machine) {
  tracker.get(operation("sigma_range_um"), machine.sigma_range_m, kMicro, kPositive);
  tracker.get(operation("sigma_angle_urad"), machine.sigma_angle_rad, kMicro, kPositive);
  tracker.get(operation("u_range_offset_um"), machine.u_range_offset_m, kMicro, kNotNegative);
}

/// Reads the keys about the place of the tracker. Call it after the keys about noise were read.
void read_place(ClassifiedSection& tracker, MachineConfig& machine) {
  constexpr std::size_t kLongest = 64;
  tracker.get_maybe_empty(operation("place"), machine.tracker_place);
  if (machine.tracker_place.size() > kLongest)
    tracker.fault("place", fmt::format("must be at most {} bytes long", kLongest));
  if (!machine.tracker_place.empty() && machine.u_range_offset_m == 0.0)
    tracker.fault("place",
                  "needs u_range_offset_um > 0: runs from one place have the offset of the ranges "
                  "in common");
}

void read_placement(ClassifiedSection& tracker, MachineConfig& machine) {
  TrackerVertical vertical = TrackerVertical::PlusZ;
  if (tracker.get_word<TrackerVertical>(operation("vertical"), vertical,
                                        {{"+X", TrackerVertical::PlusX},
                                         {"-X", TrackerVertical::MinusX},
                                         {"+Y", TrackerVertical::PlusY},
                                         {"-Y", TrackerVertical::MinusY},
                                         {"+Z", TrackerVertical::PlusZ},
                                         {"-Z", TrackerVertical::MinusZ}}))
    machine.tracker_vertical = vertical;
  std::vector<double> position_m;

  if (!tracker.get(operation("position_mm"), position_m, kMilli)) return;
  if (position_m.size() == 3)
    machine.tracker_position_m = {position_m[0], position_m[1], position_m[2]};
  else
    tracker.fault("position_mm", "must be three numbers, x, y, z in machine coordinates");
}

NestConfig read_nest(ClassifiedSection& section) {
  constexpr Bounds kRadius_mm{0.5, 200.0};
  NestConfig nest;
  std::vector<double> position_m;
  section.get(operation("name"), nest.name, Need::Required);
  if (section.get(operation("position_mm"), position_m, kMilli, Need::Required)) {
    if (position_m.size() == 3)
      nest.position_tracker_m = {position_m[0], position_m[1], position_m[2]};
    else
      section.fault("position_mm", "must be three numbers, x, y, z in the tracker frame");
  }
  section.get(operation("radius_mm"), nest.radius_m, kMilli, kRadius_mm);
  section.close();
  return nest;
}

void read_nests(ClassifiedSection& tracker, OtfConfig& out) {
  constexpr Bounds kRepeatability_um{0.1, 100.0};
  tracker.get(operation("nest_repeatability_um"), out.u_nest_repeatability_m, kMicro,
              kRepeatability_um);
  for (auto& section : tracker.children("nest", "name")) {
    out.nests.push_back(read_nest(section));
    if (out.nests.back().name.empty()) continue;
    if (const auto valid = calib::otf::find_nest_visits({}, nest_options(out), {}); !valid)
      section.fault("", valid.error().text);
  }
}

/// Reads point_rate_hz. The measurement period of emScon is a whole number of milliseconds; a rate
/// with another period is a fault, because the controller would change it silently.
void read_point_rate(ClassifiedSection& tracker, TrackerConfig& out) {
  constexpr double kRounded = 5e-3;  // relative; accepts 333 for 333.3
  if (!tracker.get(operation("point_rate_hz"), out.point_rate_hz, kPlain, {1.0, 1000.0})) return;
  const double period_ms = std::round(1e3 / out.point_rate_hz);
  if (std::abs(out.point_rate_hz * period_ms / 1e3 - 1.0) > kRounded)
    tracker.fault("point_rate_hz",
                  fmt::format("the period must be a whole number of ms: use {:.4g} or {:.4g}",
                              1e3 / std::ceil(1e3 / out.point_rate_hz),
                              1e3 / std::floor(1e3 / out.point_rate_hz)));
  out.point_rate_hz = 1e3 / period_ms;
}

/// Adds a fault for each key that applies only to the other mode: ignoring it silently would hide a
/// mistake.
void read_tracker_mode(ClassifiedSection& tracker, TrackerConfig& out) {
  constexpr int kLongest_ms = 60'000;  // longest time that emScon accepts
  tracker.get_word<TrackerModeConfig>(operation("mode"), out.mode,
                                      {{"continuous", TrackerModeConfig::Continuous},
                                       {"stationary", TrackerModeConfig::Stationary}});

  if (out.mode == TrackerModeConfig::Stationary) {
    int time_ms = static_cast<int>(out.stationary_time / std::chrono::milliseconds{1});
    tracker.get_integer(operation("stationary_time_ms"), time_ms, 1, kLongest_ms);
    out.stationary_time = std::chrono::milliseconds{time_ms};
    if (tracker.has("point_rate_hz"))
      tracker.fault("point_rate_hz", "has no meaning with mode = \"stationary\"");
  } else {
    read_point_rate(tracker, out);
    if (tracker.has("stationary_time_ms"))
      tracker.fault("stationary_time_ms", "has no meaning with mode = \"continuous\"");
  }
}

void read_tracker_timeouts(ClassifiedSection& tracker, Role points, TrackerConfig& out) {
  tracker.get(Key{"max_constant_delay_us", points}, out.max_constant_delay, kMicro, kNotNegative);
  tracker.get(operation("connect_timeout_s"), out.connect_timeout, kPlain, kPositive);
  tracker.get(operation("command_timeout_s"), out.command_timeout, kPlain, {0.01, 600.0});
  tracker.get(operation("initialize_timeout_s"), out.initialize_timeout, kPlain, kPositive);
  tracker.get(operation("silence_timeout_s"), out.silence_timeout, kPlain, kPositive);
}

void read_search(ClassifiedSection& tracker, TrackerConfig& out) {
  constexpr Bounds kRadius_mm{0.1, 10e3}, kTimeout_s{0.1, 600.0};
  TrackerSearchConfig search;
  const bool radius =
      tracker.get(operation("search_radius_mm"), search.radius_m, kMilli, kRadius_mm);
  const bool timeout =
      tracker.get(operation("search_timeout_s"), search.timeout, kPlain, kTimeout_s);
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

/// Reads the keys for the reflector and for the way in which the tracker finds it.
void read_beam(ClassifiedSection& tracker, Role points, TrackerConfig& out) {
  tracker.get_maybe_empty(Key{"reflector", points}, out.reflector);
  if (out.reflector.size() > drivers::kLongestReflectorName)
    tracker.fault("reflector",
                  fmt::format("must be at most {} bytes long, the limit of the controllers",
                              drivers::kLongestReflectorName));
  tracker.get(operation("home_after_initialize"), out.home_after_initialize);
  read_search(tracker, out);
}

/// The default of u_scale. `air` is the TOML table [air], which is read after [tracker]; null if
/// absent.
double default_u_scale(WeatherConfig weather, const toml::node* air) {
  if (weather == WeatherConfig::Compute) return TrackerConfig::kControllersAir;
  const bool corrected =
      air != nullptr && air->is_table() && air->as_table()->contains("assumed_index");
  return corrected ? 0.0 : u_of_unmeasured_air();
}

/// Same as read_tracker_mode(), for a program that sends lines of text. The program determines rate
/// and duration; abbe must know them.
void read_mode_of_lines(ClassifiedSection& tracker, TrackerConfig& out) {
  using protocol::lines::Column;
  constexpr std::int64_t kLongest_ms = 60'000;
  tracker.get_word<TrackerModeConfig>(operation("mode"), out.mode,
                                      {{"continuous", TrackerModeConfig::Continuous},
                                       {"stationary", TrackerModeConfig::Stationary}});
  const bool stationary = out.mode == TrackerModeConfig::Stationary;
  if (stationary) {
    std::int64_t time_ms = out.stationary_time / std::chrono::milliseconds{1};
    tracker.get_integer(operation("stationary_time_ms"), time_ms, 1, kLongest_ms, Need::Required);
    out.stationary_time = std::chrono::milliseconds{time_ms};
    // the line may be silent this long, because a person moves the reflector meanwhile
    out.silence_timeout = std::chrono::seconds{60};
  } else {
    tracker.get(operation("point_rate_hz"), out.point_rate_hz, kPlain, {0.1, 10e3}, Need::Required);
    if (out.lines->format.column_count > 0 && !out.lines->format.has(Column::Time))
      tracker.fault("columns",
                    "needs \"time\": lines come in bursts, so their arrival does not show when a "
                    "point was measured (without it only mode = \"stationary\" is possible)");
  }
  const auto unused = stationary ? "point_rate_hz" : "stationary_time_ms";
  if (tracker.has(unused))
    tracker.fault(unused, fmt::format("has no meaning with mode = \"{}\"",
                                      stationary ? "stationary" : "continuous"));
}

/// Reads a tracker whose points come as lines of text. Keys for commands to a controller have no
/// meaning here.
void read_line_tracker(ClassifiedSection& tracker, const toml::node* air, TrackerConfig& out) {
  tracker.state(Role::Measurement, "protocol", "lines");
  out.lines = read_lines(tracker);
  read_mode_of_lines(tracker, out);
  tracker.get_word<WeatherConfig>(
      measurement("weather"), out.weather,
      {{"none", WeatherConfig::None}, {"compute", WeatherConfig::Compute}}, Need::Required);
  if (!tracker.get(operation("u_scale_ppm"), out.u_scale, kMicro, kNotNegative))
    out.u_scale = default_u_scale(out.weather, air);
  tracker.get(measurement("max_constant_delay_us"), out.max_constant_delay, kMicro, kNotNegative);
  tracker.get(operation("connect_timeout_s"), out.connect_timeout, kPlain, kPositive);
  tracker.get(operation("silence_timeout_s"), out.silence_timeout, kPlain, kPositive);
  for (const auto key : {"command_timeout_s", "initialize_timeout_s", "reflector",
                         "home_after_initialize", "search_radius_mm", "search_timeout_s"})
    if (tracker.has(key))
      tracker.fault(key, "has no meaning with protocol = \"lines\": abbe sends nothing");
}

void read_emscon_tracker(ClassifiedSection& tracker, const toml::node* air, TrackerConfig& out) {
  refuse_lines_keys(tracker);
  const Role points = tracker.has("host") ? Role::Measurement : Role::Operation;
  const bool has_host = get_host(tracker, operation("host"), out.host);
  tracker.get_integer(operation("port"), out.port, 1, 65535);
  read_tracker_mode(tracker, out);
  tracker.get_word<WeatherConfig>(Key{"weather", points}, out.weather,
                                  {{"none", WeatherConfig::None},
                                   {"read", WeatherConfig::Read},
                                   {"compute", WeatherConfig::Compute}});

  if (!tracker.get(operation("u_scale_ppm"), out.u_scale, kMicro, kNotNegative))
    out.u_scale = default_u_scale(out.weather, air);
  read_tracker_timeouts(tracker, points, out);
  read_beam(tracker, points, out);
  if (!has_host && tracker.has("port") && !tracker.has("host"))
    tracker.fault("host", "missing, but a port is given");
}

void read_tracker(ClassifiedSection& root, Config& out, StreamNames& names) {
  ClassifiedSection tracker = root.child("tracker");
  read_noise(tracker, out.machine);
  read_place(tracker, out.machine);
  read_placement(tracker, out.machine);
  read_nests(tracker, out.otf);
  if (!out.machine.tracker_place.empty() && !out.otf.nests.empty())
    tracker.fault("place",
                  "needs no [[tracker.nest]]: with nests the offset of the ranges is "
                  "estimated beside the drift, and is not kept");
  TrackerConfig config;
  get_bounded(tracker, operation("name"), config.name, bound_of<v1::TrackerPoint>("device"));
  bool as_lines = false;
  tracker.get_word<bool>(operation("protocol"), as_lines, {{"emscon", false}, {"lines", true}});
  const toml::node* const air = root.node(stated("air"));
  if (as_lines)
    read_line_tracker(tracker, air, config);
  else
    read_emscon_tracker(tracker, air, config);
  tracker.close();
  if (!as_lines && config.host.empty()) return;
  names.take(config.name, tracker);
  out.of<TrackerConfig>() = std::move(config);
}

std::vector<std::string> tracker_summary(const Config& config) {
  const auto& tracker = config.of<TrackerConfig>();
  if (!tracker) return {};
  const auto mode = tracker->mode == TrackerModeConfig::Stationary
                        ? std::string{"stationary"}
                        : fmt::format("{:g} points per second", tracker->point_rate_hz);
  if (tracker->lines)
    return {fmt::format("lines ({}) from {}, {}", format_text(tracker->lines->format),
                        drivers::text_of(tracker->lines->address), mode)};
  return {fmt::format("{}:{}, {}", tracker->host, tracker->port, mode)};
}

std::optional<TrackerSource> points_of_tracker(const Config& config) {
  const auto& tracker = config.of<TrackerConfig>();
  if (!tracker) return std::nullopt;
  TrackerSource source{.key = TrackerConfig::kKind.key,
                       .device = tracker->name,
                       .point_rate_hz = tracker->point_rate_hz,
                       .u_scale = tracker->u_scale};
  if (tracker->mode == TrackerModeConfig::Stationary)
    source.stationary_time = tracker->stationary_time;

  switch (tracker->weather) {
    case WeatherConfig::None:
      // For a program that sends lines of text, abbe cannot set the air.
      source.air = tracker->lines ? TrackerSource::Air::LastSet : TrackerSource::Air::Assumed;
      source.air_setting = "tracker.weather = \"none\"";
      break;
    case WeatherConfig::Read:
      source.air = TrackerSource::Air::LastSet;
      source.air_setting = "tracker.weather = \"read\"";
      break;
    case WeatherConfig::Compute:
      source.air = TrackerSource::Air::Measured;
      source.air_setting = "tracker.weather = \"compute\"";
      break;
  }

  return source;
}

}  // namespace

Result<TrackerConfig> parse_tracker_table(std::string_view text) {
  const std::string name = "[tracker]";
  const auto table = parse_toml(text, name);
  ABBE_TRY(table);
  Faults faults(name, kMostConfigFaults);
  Config config;
  StreamNames names;
  ClassifiedSection root{Section{&*table, "", {1, 1}, faults, Origin::Written}, "", config.meaning};
  read_tracker(root, config, names);
  root.close();
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  if (!config.of<TrackerConfig>()) return fail(ErrorCode::BadInput, name + ": has no host");
  return *config.of<TrackerConfig>();
}

const ConfigKind TrackerConfig::kKind{.key = "tracker",
                                      .needs = "host",
                                      .read = &read_tracker,
                                      .summary = &tracker_summary,
                                      .points = &points_of_tracker};

}  // namespace abbe::daemon
