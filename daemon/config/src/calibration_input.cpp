#include "abbe/config/calibration_input.hpp"

#include <fmt/format.h>

#include <array>
#include <string>
#include <utility>

#include "abbe/config/calib_error.hpp"

namespace abbe::daemon {
namespace {

template <class Config, class Calib, std::size_t N>
using Pairs = std::array<std::pair<Config, Calib>, N>;

constexpr Pairs<TableInterpolation, calib::Interpolation, 3> kInterpolations{
    {{TableInterpolation::Linear, calib::Interpolation::Linear},
     {TableInterpolation::NaturalCubic, calib::Interpolation::NaturalCubic},
     {TableInterpolation::NotAKnotCubic, calib::Interpolation::NotAKnotCubic}}};
constexpr Pairs<AirEquation, calib::IndexEquation, 3> kEquations{
    {{AirEquation::Ciddor, calib::IndexEquation::Ciddor},
     {AirEquation::Edlen, calib::IndexEquation::Edlen},
     {AirEquation::ShopFloor, calib::IndexEquation::ShopFloor}}};
constexpr Pairs<OtfMode, calib::otf::Mode, 2> kModes{
    {{OtfMode::OnTheFly, calib::otf::Mode::OnTheFly},
     {OtfMode::Standstill, calib::otf::Mode::Standstill}}};
constexpr Pairs<OtfEstimator, calib::otf::Estimator, 2> kEstimators{
    {{OtfEstimator::TwoStep, calib::otf::Estimator::TwoStep},
     {OtfEstimator::Simultaneous, calib::otf::Estimator::Simultaneous}}};
constexpr Pairs<OtfBacklash, calib::TravelDependence, 3> kBacklash{
    {{OtfBacklash::None, calib::TravelDependence::None},
     {OtfBacklash::PerTable, calib::TravelDependence::Backlash},
     {OtfBacklash::PerNode, calib::TravelDependence::Tables}}};

template <class Config, class Calib, std::size_t N>
Calib second_of(const Pairs<Config, Calib, N>& pairs, Config value) {
  for (const auto& [config, calib] : pairs)
    if (config == value) return calib;
  return pairs.front().second;
}
template <class Config, class Calib, std::size_t N>
Config first_of(const Pairs<Config, Calib, N>& pairs, Calib value) {
  for (const auto& [config, calib] : pairs)
    if (calib == value) return config;
  return pairs.front().first;
}

// The defaults of the configuration are those of calib.
static_assert(AirConfig{}.wavelength_m == calib::kHeliumNeon_m);

}  // namespace

calib::Interpolation calib_of(TableInterpolation v) noexcept {
  return second_of(kInterpolations, v);
}
TableInterpolation config_of(calib::Interpolation v) noexcept {
  return first_of(kInterpolations, v);
}
calib::IndexEquation calib_of(AirEquation v) noexcept {
  return second_of(kEquations, v);
}
calib::otf::Mode calib_of(OtfMode v) noexcept {
  return second_of(kModes, v);
}
OtfMode config_of(calib::otf::Mode v) noexcept {
  return first_of(kModes, v);
}
calib::otf::Estimator calib_of(OtfEstimator v) noexcept {
  return second_of(kEstimators, v);
}
OtfEstimator config_of(calib::otf::Estimator v) noexcept {
  return first_of(kEstimators, v);
}
calib::TravelDependence calib_of(OtfBacklash v) noexcept {
  return second_of(kBacklash, v);
}
OtfBacklash config_of(calib::TravelDependence v) noexcept {
  return first_of(kBacklash, v);
}

calib::otf::NestOptions nest_options(const OtfConfig& otf) {
  calib::otf::NestOptions options{.u_repeatability_m = otf.u_nest_repeatability_m};
  for (const NestConfig& nest : otf.nests) {
    const auto& p = nest.position_tracker_m;
    options.nests.push_back({nest.name, {p[0], p[1], p[2]}, nest.radius_m});
  }
  return options;
}

std::optional<calib::otf::SmoothnessOptions> smoothness_options(const OtfConfig& otf) {
  if (!otf.smoothness_m) return std::nullopt;
  return calib::otf::SmoothnessOptions{.bend_m = *otf.smoothness_m};
}

Result<calib::otf::Machine> otf_machine(const MachineConfig& machine) {
  auto chain = calib::KinematicChain::parse(machine.chain);
  if (!chain) return tl::unexpected(error_of(chain.error()));
  calib::otf::Machine out;
  out.chain = *chain;

  for (const calib::Axis a : calib::kAllAxes) {
    const std::string axis_name(1, calib::letter(a));
    const AxisConfig* axis = machine.find_axis(axis_name);
    const auto nodes = machine.nodes_m.find(axis_name);
    if (axis == nullptr || nodes == machine.nodes_m.end()) {
      return fail(ErrorCode::BadInput,
                  fmt::format("machine {}: axis {} has no range", machine.name, axis_name));
    }
    out.nodes[calib::index(a)] = {.nodes_m = nodes->second, .reference_m = axis->reference};
  }

  out.target_offset_m = {machine.target_offset_m[0], machine.target_offset_m[1],
                         machine.target_offset_m[2]};
  out.interpolation = calib_of(machine.interpolation);
  return out;
}

Result<void> require_target(const MachineConfig& machine) {
  if (machine.target_given) return {};
  return fail(
      ErrorCode::BadInput,
      fmt::format(
          "machine {}: [target] offset_mm is missing: add [target] with offset_mm = [x, y, z], the "
          "centre of the reflector or stylus tip relative to the tool reference point, in mm along "
          "the machine axes; [0, 0, 0] if the two points coincide",
          machine.name));
}

}  // namespace abbe::daemon
