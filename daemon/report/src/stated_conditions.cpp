#include "stated_conditions.hpp"

#include <fmt/format.h>

#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

using Number = StatedCondition::Number;

constexpr const char* kCelsius = "\\degreecelsius";

std::string celsius(double temperature_K) {
  return fmt::format("{:.2f}", temperature_K - kZeroCelsius_K);
}

/// The conditions that the run recorded; all are absent in models of earlier versions.
RunFigures::Conditions recorded(const ModelDocument& document) {
  return document.run && document.run->conditions ? *document.run->conditions
                                                  : RunFigures::Conditions{};
}

std::vector<Number> range_of(const std::string& name, const std::array<double, 2>& range_K) {
  return {{name + ", lowest", celsius(range_K[0])}, {name + ", highest", celsius(range_K[1])}};
}

StatedCondition temperature(const ModelDocument& document, const CertificateDetails& d) {
  StatedCondition c{.name = "temperature", .unit = "C", .dsi_unit = kCelsius};
  if (d.temperature_C) {
    c.numbers = {{c.name, fmt::format("{:.2f}", *d.temperature_C),
                  d.u_temperature_K ? fmt::format("{:.2f}", 2.0 * *d.u_temperature_K) : ""}};
    return c;
  }
  // For the ball array, earlier versions wrote the temperature of the array there.
  const auto range_K = recorded(document).temperature_K;
  if (!range_K || document.method == "evemu") return c;
  c.origin = "lowest and highest value of all sensors";
  c.numbers = range_of(c.name, *range_K);
  return c;
}

/// Adds the temperature of the ball array, or that of the bar in its measurements.
void add_artefact(const ModelDocument& document, std::vector<StatedCondition>& all) {
  if (const auto& array = document.artefact) {
    StatedCondition c{.name = "temperature of the ball array", .unit = "C", .dsi_unit = kCelsius};
    c.origin = fmt::format("corrected with {:.2f} um/(m K)", kUmPerM * array->alpha_per_K);
    c.numbers = {{c.name, celsius(array->temperature_K),
                  fmt::format("{:.2f}", 2.0 * array->u_temperature_K)}};
    all.push_back(std::move(c));
  }
  if (const auto bar_K = recorded(document).bar_temperature_K) {
    StatedCondition c{.name = "temperature of the bar", .unit = "C", .dsi_unit = kCelsius};
    c.origin = "lowest and highest value as used in the measurements";
    c.numbers = range_of(c.name, *bar_K);
    all.push_back(std::move(c));
  }
}

StatedCondition feed(const ModelDocument& document, const CertificateDetails& d) {
  StatedCondition c{
      .name = "feed", .unit = "mm/min", .dsi_unit = "\\milli\\metre\\minute\\tothe{-1}"};
  if (d.feed_mm_per_min) {
    c.numbers = {{c.name, fmt::format("{}", *d.feed_mm_per_min)}};
  } else if (const auto feed = recorded(document).feed_m_per_s) {
    constexpr double kSecondsPerMinute = 60.0;
    c.origin = "median over the legs";
    c.numbers = {{c.name, fmt::format("{:.0f}", kMmPerM * kSecondsPerMinute * *feed)}};
  }
  return c;
}

StatedCondition measuring_time(const ModelDocument& document) {
  StatedCondition c{.name = "measuring time", .unit = "s", .dsi_unit = "\\second"};
  const auto duration_s = recorded(document).duration_s;
  if (!duration_s) return c;
  const bool several_runs = document.method == "otf" && document.run->places_m.size() > 1;
  c.origin = several_runs ? "sum of the runs, without the pauses between them"
                          : "from the first to the last observation";
  c.numbers = {{c.name, fmt::format("{:.1f}", *duration_s)}};
  return c;
}

}  // namespace

std::vector<StatedCondition> stated_conditions(const ModelDocument& document,
                                               const CertificateDetails& details) {
  std::vector<StatedCondition> all{temperature(document, details)};
  add_artefact(document, all);
  if (details.humidity_percent)
    all.push_back({.name = "humidity",
                   .unit = "%",
                   .dsi_unit = "\\percent",
                   .numbers = {{"humidity", fmt::format("{}", *details.humidity_percent)}}});
  all.push_back(feed(document, details));
  all.push_back(measuring_time(document));
  return all;
}

std::string in_words(const StatedCondition& condition) {
  const auto& numbers = condition.numbers;
  if (numbers.empty()) return "not recorded";
  std::string text = numbers.front().value;
  if (numbers.size() > 1) text += " to " + numbers.back().value;
  if (!numbers.front().U.empty()) text += " \u00b1 " + numbers.front().U;
  text += " " + condition.unit;
  if (!numbers.front().U.empty()) text += " (k = 2)";
  return condition.origin.empty() ? text : text + ", " + condition.origin;
}

}  // namespace abbe::daemon
