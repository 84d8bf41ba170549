#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "abbe/base/units.hpp"
#include "abbe/calib/evemu/scaled_design.hpp"
#include "abbe/calib/evemu/solve.hpp"
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

  if (section.get("artefact_sensor", sensor)) {
    const auto found = std::ranges::find(temperatures, sensor);
    if (found == temperatures.end())
      section.fault("artefact_sensor", fmt::format("no {} measures a temperature \"{}\"",
                                                   tables_with(Capability::Environment), sensor));
    artefact.sensor = static_cast<std::uint8_t>(found - temperatures.begin());
  }

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
  section.get_integer("order", evemu.order, calib::evemu::kLeastOrder, calib::evemu::kMostOrder);
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

}  // namespace abbe::daemon
