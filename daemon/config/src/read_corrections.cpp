#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "abbe/config/capabilities.hpp"
#include "readers.hpp"

namespace abbe::daemon {

void read_thermal(ClassifiedSection& root, Config& out) {
  std::set<std::string> axes;
  const auto connected = out.connected_axes();
  for (auto& section : root.children("thermal", "axis")) {
    ThermalConfig config;
    std::string temperature;
    if (section.get(stated("axis"), config.axis, Need::Required)) {
      const AxisConfig* axis = out.machine.find_axis(config.axis);
      if (axis == nullptr || axis->kind != AxisKind::Linear)
        section.fault("axis", "no such linear axis in [axes]");
      if (!axes.insert(config.axis).second) section.fault("axis", "has two [[thermal]] tables");
      if (!connected.empty() &&
          std::find(connected.begin(), connected.end(), config.axis) == connected.end())
        section.fault("axis", fmt::format("is read by neither {}",
                                          tables_with(Capability::NamedAxes, "nor")));
    }

    if (section.get(reading("temperature"), temperature, Need::Required)) {
      const auto found = std::find(out.temperatures.begin(), out.temperatures.end(), temperature);
      if (found == out.temperatures.end())
        section.fault("temperature", fmt::format("no {} measures it: check the name",
                                                 tables_with(Capability::Environment)));
      config.temperature = static_cast<std::uint8_t>(found - out.temperatures.begin());
    }

    section.get(reading("alpha_um_per_m_K"), config.alpha_per_K, kMicro, {-50.0, 50.0},
                Need::Required);
    section.get(operation("u_alpha_um_per_m_K"), config.u_alpha_per_K, kMicro, {0.0, 50.0},
                Need::Required);
    section.get(operation("u_temperature_K"), config.u_temperature_K, kPlain, {0.0, 50.0},
                Need::Required);
    section.get(reading("fixed_mm"), config.fixed_m, kMilli, kAny, Need::Required);

    if (out.axes_compensated())
      section.fault("", "the control corrects these readings already (axes_compensated)");
    section.close();
    out.thermal.push_back(std::move(config));
  }
}

void read_air(ClassifiedSection& root, Config& out) {
  ClassifiedSection air = root.child("air");
  AirConfig& config = out.air;
  // If assumed_index is absent, the refractive index is only shown.
  const Role index = air.has("assumed_index") ? Role::Measurement : Role::Operation;
  air.get_word<AirEquation>(Key{"equation", index}, config.equation,
                            {{"ciddor", AirEquation::Ciddor},
                             {"edlen", AirEquation::Edlen},
                             {"shop_floor", AirEquation::ShopFloor}});
  air.get(Key{"wavelength_nm", index}, config.wavelength_m, kNano, {350.0, 1200.0});
  air.get(Key{"co2_ppm", index}, config.co2_ppm, kPlain, {0.0, 2000.0});
  air.get(operation("u_temperature_K"), config.u_temperature_K, kPlain, {0.0, 10.0});
  air.get(operation("u_pressure_Pa"), config.u_pressure_Pa, kPlain, {0.0, 1e4});
  air.get(operation("u_humidity_percent"), config.u_relative_humidity, {100.0}, {0.0, 100.0});
  air.get(operation("u_co2_ppm"), config.u_co2_ppm, kPlain, {0.0, 2000.0});
  air.get(operation("max_age_s"), config.max_age, kPlain, kPositive);
  double assumed = 1.0;

  if (air.get(if_given(measurement("assumed_index")), assumed, kPlain, {1.0, 1.001})) {
    config.assumed_index = assumed;
    const bool air_is_fully_measured =
        (measured_environment(out) & protocol::kAllOfTheAir) == protocol::kAllOfTheAir;
    const auto tracker = tracker_source(out);
    if (tracker && tracker->air == TrackerSource::Air::Measured)
      air.fault("assumed_index", fmt::format("the controller computes the index already ({})",
                                             tracker->air_setting));
    if (tracker && tracker->air == TrackerSource::Air::Assumed && !air_is_fully_measured)
      air.fault("assumed_index",
                fmt::format("with {} an {} must measure temperature, "
                            "pressure and humidity of the air",
                            tracker->air_setting, tables_with(Capability::Environment)));
  }

  air.close();
}

}  // namespace abbe::daemon
