#include "abbe/web/curve_values.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "abbe/base/units.hpp"

namespace abbe::web {
namespace {

using nlohmann::json;
using Time = CurveHistory::Clock::time_point;

constexpr const char* kTemperatures = "Temperatures";
constexpr const char* kCelsius = "\u00b0C";

void add(CurveHistory& curves, const CurveName& curve, const json& values, const char* key,
         Time now, double factor = 1.0) {
  const auto value = values.find(key);
  if (value != values.end() && value->is_number())
    curves.add(curve, factor * value->get<double>(), now);
}

/// The recorder is listed among the streams, too.
bool is_device(const json& stream) {
  return !stream.contains("behind_s") && stream.value("rate_hz", 0.0) > 0.0;
}

bool delivers(const json& stream) {
  return is_device(stream) && stream.value("connected", false);
}

void add_environment(CurveHistory& curves, const json& environment, Time now) {
  add(curves, {kTemperatures, "air", kCelsius}, environment, "air_temperature_C", now);
  const auto temperatures = environment.value("temperatures_C", json::object());
  for (const auto& [name, value] : temperatures.items())
    if (value.is_number()) curves.add({kTemperatures, name, kCelsius}, value.get<double>(), now);
  add(curves, {"Air pressure", "pressure", "hPa"}, environment, "air_pressure_hPa", now);
  add(curves, {"Relative humidity", "humidity", "%"}, environment, "relative_humidity_percent",
      now);
}

}  // namespace

void add_positions(CurveHistory& curves, const json& axes, const json& positions, Time now) {
  for (std::size_t i = 0; i < std::min(axes.size(), positions.size()); ++i) {
    if (!positions[i].is_number()) continue;
    const double value = positions[i].get<double>();
    const auto name = axes[i].value("axis", std::string{});
    if (axes[i].value("kind", std::string{}) == "rotary")
      curves.add({"Rotary axes", name, "\u00b0"}, value * 180.0 / std::numbers::pi, now);
    else
      curves.add({"Linear axes", name, "mm"}, value * daemon::kMmPerM, now);
  }
}

void add_status(CurveHistory& curves, const json& status, Time now) {
  const auto streams = status.value("streams", json::array());
  if (std::ranges::any_of(streams, delivers) && status.contains("environment"))
    add_environment(curves, status["environment"], now);

  const auto session = status.value("session", json::object());
  if (session.value("state", std::string{}) == "acquiring" && session.contains("live")) {
    const double factor = session["live"].value("variance_factor", 0.0);
    if (factor > 0.0)
      curves.add({"Residuals of the calibration", "rms / stated noise", "1"}, std::sqrt(factor),
                 now);
  }

  constexpr double kUsPerS = 1e6;
  for (const json& stream : streams) {
    const auto clock = stream.value("clock", json::object());
    if (delivers(stream) && clock.value("settled", false))
      add(curves, {"Residuals of the device clocks", stream.value("name", std::string{}), "us"},
          clock, "residual_s", now, kUsPerS);
  }
}

}  // namespace abbe::web
