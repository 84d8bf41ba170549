#include "abbe/pipeline/counting_state.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <system_error>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/sha256.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

constexpr int kCountingSchema = 1;
constexpr std::size_t kMostBytes = 65536;

json json_of(const drivers::quad08::Debounce& debounce) {
  return {debounce.enabled, debounce.time_code, debounce.falling, debounce.trigger_before_stable};
}

json json_of(const drivers::CounterAxis& axis) {
  return {{"name", axis.name},
          {"channel", axis.channel},
          {"scale", axis.scale},
          {"offset", axis.offset},
          {"latched", axis.latch_on_index},
          {"debounce", json_of(axis.debounce)}};
}

json json_of(const AxisMarks& marks) {
  return {{"axis", marks.axis},
          {"increment", marks.code.increment},
          {"length", marks.code.length},
          {"rotary", marks.code.rotary},
          {"signal_period", marks.signal_period},
          {"zero_mark", marks.zero_mark},
          {"reversed", marks.reversed}};
}

json json_of(const FoundZero& zero) {
  return {{"axis", zero.axis},
          {"reading_at_zero", zero.reading_at_zero},
          {"u", zero.u},
          {"stated", zero.stated}};
}

FoundZero zero_from(const json& content) {
  return FoundZero{.axis = content.at("axis").get<std::size_t>(),
                   .reading_at_zero = content.at("reading_at_zero").get<double>(),
                   .u = content.at("u").get<double>(),
                   .stated = content.at("stated").get<bool>()};
}

/// The state in the JSON text. nullopt if it has more axes than a sample can have, or an invalid
/// zero. Throws json::exception if a member is missing or has the wrong type.
std::optional<CountingState> state_from(const json& content) {
  CountingState state;
  state.boot_id = content.at("boot_id").get<std::string>();
  state.set_up = content.at("set_up").get<std::string>();
  auto& progress = state.counting.progress;
  progress.set_serial_number(content.at("serial_number").get<std::string>());
  progress.head.time =
      protocol::HostTime{std::chrono::nanoseconds{content.at("host_time_ns").get<std::int64_t>()}};
  progress.clock_count = content.at("clock_count").get<std::int64_t>();
  const auto counts = content.at("counts").get<std::vector<std::int64_t>>();
  if (counts.size() > progress.count.size()) return std::nullopt;
  progress.axis_count = static_cast<std::uint8_t>(counts.size());
  std::ranges::copy(counts, progress.count.begin());

  for (const auto& found : content.at("datum")) {
    const auto& zero = state.counting.zero.emplace_back(zero_from(found));
    if (zero.axis >= counts.size() || !std::isfinite(zero.reading_at_zero) ||
        !std::isfinite(zero.u))
      return std::nullopt;
  }

  return state;
}

json json_of(const CountingState& state) {
  const auto& progress = state.counting.progress;
  json zero = json::array();
  for (const auto& found : state.counting.zero) zero.push_back(json_of(found));
  return {{"boot_id", state.boot_id},
          {"set_up", state.set_up},
          {"serial_number", progress.serial_number()},
          {"host_time_ns", progress.head.time.time_since_epoch().count()},
          {"clock_count", progress.clock_count},
          {"counts", std::vector<std::int64_t>(progress.count.begin(),
                                               progress.count.begin() + progress.axis_count)},
          {"datum", std::move(zero)}};
}

/// Names of the members in which two set-ups differ.
std::string differences(const std::string& before, const std::string& now) {
  const auto was = parse_json(before, "set-up"), is = parse_json(now, "set-up");
  if (!was || !is || !was->is_object() || !is->is_object())
    return "the earlier set-up cannot be read";
  std::string names;
  for (const auto& [name, value] : is->items())
    if (!was->contains(name) || was->at(name) != value) names += (names.empty() ? "" : ", ") + name;
  return names.empty() ? "the file was written by another version of abbed" : names;
}

/// Renames a damaged file and returns a text about the outcome. The next run writes a new file.
std::string rename_damaged(const std::filesystem::path& file) {
  const std::filesystem::path renamed = file.string() + ".damaged";
  std::error_code failed;
  std::filesystem::rename(file, renamed, failed);
  return failed ? fmt::format("it cannot be renamed: {}", failed.message())
                : fmt::format("it is kept as {}", renamed.string());
}

constexpr std::string_view kNotReferenced = "the axes of the counter card are not referenced";

}  // namespace

std::string counting_set_up(const Config& config) {
  const drivers::CounterCardWiring& wiring = counted_axes(config)->card.wiring;
  json axes = json::array();
  for (const auto& axis : wiring.axes) axes.push_back(json_of(axis));
  json marks = json::array();
  if (const ReferenceMarks* const found_at = reference_marks(config))
    for (const AxisMarks& axis : found_at->axes) marks.push_back(json_of(axis));
  const json set_up{
      {"axes", std::move(axes)},
      {"clock", {wiring.clock_channel, static_cast<int>(wiring.clock_source), wiring.clock_hz}},
      {"probe",
       {wiring.latch_channel ? *wiring.latch_channel : -1,
        wiring.edge_channel ? *wiring.edge_channel : -1, json_of(wiring.latch_debounce),
        json_of(wiring.edge_debounce)}},
      {"width", static_cast<int>(wiring.width)},
      {"reference", std::move(marks)},
      {"speed", config.daemon.speed}};

  return json_text(set_up);
}

std::string boot_id() {
  std::string id;
  if (std::ifstream file{"/proc/sys/kernel/random/boot_id"}; file >> id) return id;
  // NOLINT(concurrency-mt-unsafe): never set here
  const char* const given = std::getenv("ABBE_BOOT_ID");
  return given != nullptr ? given : "";
}

std::filesystem::path counting_state_file(const std::filesystem::path& data_dir) {
  return data_dir / kCountingStateName;
}

std::string to_text(const CountingState& state) {
  const json content = json_of(state);
  return indented_json_text(json{{"schema", kCountingSchema},
                                 {"sha256", sha256_hex(json_text(content))},
                                 {"state", content}}) +
         "\n";
}

Result<CountingState> counting_state_from_text(std::string_view text, std::string_view what) {
  const auto parsed = parse_json(text, what, {.bytes = kMostBytes, .depth = 8, .values = 1000});
  ABBE_TRY(parsed);
  try {
    if (const auto schema = parsed->at("schema").get<int>(); schema != kCountingSchema)
      return fail(ErrorCode::BadInput,
                  fmt::format("{}: schema {}, expected {}", what, schema, kCountingSchema));
    const json& content = parsed->at("state");
    if (parsed->at("sha256").get<std::string>() != sha256_hex(json_text(content)))
      return fail(ErrorCode::BadInput, fmt::format("{}: its checksum is wrong", what));
    auto state = state_from(content);
    if (!state) return fail(ErrorCode::BadInput, fmt::format("{}: a number is out of range", what));
    return std::move(*state);
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", what, cause_of(e)));
  }
}

LeftCounting left_counting(const Config& config, const std::string& boot_id) {
  const auto counted = counted_axes(config);
  if (!counted) return {};
  const auto file = counting_state_file(config.daemon.data_dir);
  remove_half_written(file);
  std::error_code failed;
  if (std::filesystem::status(file, failed).type() == std::filesystem::file_type::not_found)
    return {};

  const auto refused = [&](const std::string& why) {
    return LeftCounting{.state = {}, .warning = fmt::format("{}: {}", why, kNotReferenced)};
  };

  const auto text = read_regular_file(file);
  auto state = text ? counting_state_from_text(*text, file.string()) : tl::unexpected(text.error());
  if (!state) return refused(fmt::format("{} ({})", state.error().text, rename_damaged(file)));

  const auto because = [&](const std::string& why) {
    return refused(fmt::format("{}: {}", file.string(), why));
  };
  if (boot_id.empty()) return because("the boot id of this computer cannot be read");
  if (state->boot_id != boot_id) return because("this computer was restarted since");
  const auto set_up = counting_set_up(config);
  if (state->set_up != set_up)
    return because(
        fmt::format("the set-up of the card was changed ({})", differences(state->set_up, set_up)));
  if (state->counting.progress.axis_count != counted->axes().size())
    return because(fmt::format("its number of axes differs from [{}]", counted->key));
  return {.state = std::move(*state), .warning = {}};
}

RecordingAttachment to_attachment(const CountingState& state) {
  return {.name = std::string{kCountingStateName},
          .media_type = "application/json",
          .content = to_text(state)};
}

}  // namespace abbe::daemon
