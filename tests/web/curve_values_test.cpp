/// Which values of abbed's answers become curves, and when there is a gap.

#include "abbe/web/curve_values.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

namespace abbe::web {
namespace {

using nlohmann::json;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

constexpr CurveHistory::Clock::time_point kNow{std::chrono::hours{100}};

/// "group, name, unit" and the newest value of each curve.
std::map<std::string, double> values_of(const CurveHistory& history) {
  std::map<std::string, double> values;
  const json answer = json::parse(history.window("5min", 0, kNow).value());
  for (const json& curve : answer["curves"])
    values[curve["group"].get<std::string>() + ", " + curve["name"].get<std::string>() + ", " +
           curve["unit"].get<std::string>()] = curve["mean"].back();
  return values;
}

json stream(const std::string& name, bool connected) {
  return {{"name", name},
          {"connected", connected},
          {"rate_hz", 1000.0},
          {"clock", {{"settled", true}, {"residual_s", 2e-6}}}};
}

TEST(CurveValues, PositionsAreInMmAndDegreesAndOneThatIsMissingIsNone) {
  CurveHistory history;
  const json axes{{{"axis", "X"}, {"kind", "linear"}},
                  {{"axis", "Y"}, {"kind", "linear"}},
                  {{"axis", "C"}, {"kind", "rotary"}}};
  add_positions(history, axes, json{0.25, nullptr, std::numbers::pi / 2}, kNow);
  EXPECT_THAT(values_of(history), UnorderedElementsAre(Pair("Linear axes, X, mm", 250.0),
                                                       Pair("Rotary axes, C, \u00b0", 90.0)));
}

TEST(CurveValues, EnvironmentAndResidualsAreThoseOfTheStatus) {
  CurveHistory history;
  add_status(history,
             {{"streams", {stream("encoder", true)}},
              {"session", {{"state", "acquiring"}, {"live", {{"variance_factor", 2.25}}}}},
              {"environment",
               {{"air_temperature_C", 20.5},
                {"air_pressure_hPa", nullptr},
                {"relative_humidity_percent", 45.0},
                {"temperatures_C", {{"bed", 21.25}, {"spindle", nullptr}}}}}},
             kNow);
  EXPECT_THAT(values_of(history),
              UnorderedElementsAre(Pair("Temperatures, air, \u00b0C", 20.5),
                                   Pair("Temperatures, bed, \u00b0C", 21.25),
                                   Pair("Relative humidity, humidity, %", 45.0),
                                   Pair("Residuals of the calibration, rms / stated noise, 1", 1.5),
                                   Pair("Residuals of the device clocks, encoder, us", 2.0)));
}

TEST(CurveValues, WithoutAConnectedDeviceTheLastEnvironmentIsNotCurrent) {
  CurveHistory history;
  json recorder = stream("recorder", true);
  recorder["behind_s"] = 0.0;
  add_status(history,
             {{"streams", {stream("encoder", false), recorder}},
              {"environment", {{"air_temperature_C", 20.5}}}},
             kNow);
  EXPECT_THAT(values_of(history), IsEmpty());
}

TEST(CurveValues, ASessionThatHasEndedHasNoResiduals) {
  CurveHistory history;
  add_status(history, {{"session", {{"state", "done"}, {"live", {{"variance_factor", 2.25}}}}}},
             kNow);
  EXPECT_THAT(values_of(history), IsEmpty());
}

}  // namespace
}  // namespace abbe::web
