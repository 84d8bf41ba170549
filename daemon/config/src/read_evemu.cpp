#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "abbe/base/units.hpp"
#include "abbe/calib/evemu/solve/solve.hpp"
#include "abbe/calib/geometry/scaled_design.hpp"
#include "abbe/config/capabilities.hpp"
#include "readers.hpp"

namespace abbe::daemon {

namespace {

constexpr std::int64_t kMostPoints = 1000;

void read_positions(Section& section, std::vector<int>& out) {
  std::vector<double> given;
  if (!section.get("positions", given, kPlain)) return;
  std::vector<double> sorted = given, expected(given.size());
  std::ranges::sort(sorted);
  std::iota(expected.begin(), expected.end(), 1.0);
  if (given.empty() || sorted != expected)
    return section.fault(
        "positions", fmt::format("must be the numbers 1 to {}, each once, in the order of touching",
                                 given.size()));
  out.clear();
  for (const double position : given) out.push_back(static_cast<int>(position));
}

/// The channel of the sensor `name`, which the key `key` states; 0 with a fault if no device
/// measures it.
std::uint8_t sensor_named(Section& section, std::string_view key, const std::string& name,
                          const std::vector<std::string>& temperatures) {
  const auto found = std::ranges::find(temperatures, name);
  if (found != temperatures.end()) return static_cast<std::uint8_t>(found - temperatures.begin());
  section.fault(key, fmt::format("no {} measures a temperature \"{}\"",
                                 tables_with(Capability::Environment), name));
  return 0;
}

void read_artefact_temperature(Section& section, const std::vector<std::string>& temperatures,
                               std::optional<ArtefactTemperatureConfig>& out) {
  ArtefactTemperatureConfig artefact;
  std::string sensor;
  double fixed_C = 20.0;
  const bool by_sensor = section.has("artefact_sensor"), fixed = section.has("artefact_C");
  const bool known = by_sensor || fixed;
  if (by_sensor && fixed) section.fault("artefact_C", "has no meaning with artefact_sensor");
  if (section.has("u_artefact_K") && !known)
    section.fault("u_artefact_K", "needs artefact_sensor or artefact_C");

  if (section.get("artefact_sensor", sensor))
    artefact.sensor = sensor_named(section, "artefact_sensor", sensor, temperatures);

  section.get("artefact_C", fixed_C, kPlain, {-50.0, 100.0});
  section.get("u_artefact_K", artefact.u_temperature_K, kPlain, {0.0, 50.0},
              known ? Need::Required : Need::Optional);
  artefact.fixed_K = fixed_C + kZeroCelsius_K;
  if (known) out = artefact;
}

}  // namespace

void read_evemu(ClassifiedSection& root, Config& out) {
  Section section = root.operation_table("evemu");
  auto& evemu = out.evemu;

  if (section.get("estimator", evemu.estimator) && !calib::evemu::estimator(evemu.estimator))
    section.fault(
        "estimator",
        fmt::format("\"{}\": must be bayes-pose, ols, ridge, lasso, mcp or scad", evemu.estimator));
  if (section.get("folds", evemu.folds) && !calib::evemu::folds_by(evemu.folds))
    section.fault("folds", fmt::format("\"{}\": must be position, ball or row", evemu.folds));
  section.get_integer("order", evemu.order, calib::kLeastOrder, calib::kMostOrder);
  read_positions(section, evemu.positions);
  const calib::evemu::ObserveOptions least;
  section.get_integer("points_per_ball", evemu.points_per_ball,
                      static_cast<std::int64_t>(least.least_points_per_ball), kMostPoints);
  section.get_integer("points_per_block", evemu.points_per_block,
                      static_cast<std::int64_t>(least.least_points_per_block), kMostPoints);
  section.get("longest_pause_s", evemu.longest_pause, kPlain, kPositive);
  read_artefact_temperature(section, out.temperatures, evemu.artefact);
  section.close();
}

void read_mfb(ClassifiedSection& root, Config& out) {
  Section section = root.operation_table("mfb");
  ArtefactTemperatureConfig bar;
  std::string sensor;
  const bool known = section.get("bar_sensor", sensor);
  if (known) bar.sensor = sensor_named(section, "bar_sensor", sensor, out.temperatures);
  section.get("u_bar_K", bar.u_temperature_K, kPlain, {0.0, 50.0},
              known ? Need::Required : Need::Optional);
  if (known)
    out.mfb.bar = bar;
  else if (section.has("u_bar_K"))
    section.fault("u_bar_K", "needs bar_sensor");
  section.close();
}

}  // namespace abbe::daemon
