#include "abbe/methods/mfb/inputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "abbe/config/calibration_input.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

namespace mfb = calib::mfb;

namespace {

/// Adds notes about the passes whose drift is not determined by a pair of passes.
void add_notes_on_pairs(std::span<const mfb::Measurement> measurements,
                        std::vector<std::string>& notes) {
  const auto forward_of = mfb::pairs_of(measurements);
  std::vector<bool> paired(measurements.size(), false);
  std::string single;
  for (std::size_t i = 0; i < measurements.size(); ++i)
    if (forward_of[i]) paired[i] = paired[*forward_of[i]] = true;
  for (std::size_t i = 0; i < measurements.size(); ++i)
    if (!paired[i]) single += (single.empty() ? "" : ", ") + measurements[i].name;

  if (std::ranges::none_of(paired, [](bool one) { return one; }))
    notes.emplace_back(
        "no pass was measured backward as well: a drift during the passes looks like an error of "
        "the machine");
  else if (!single.empty())
    notes.push_back(fmt::format(
        "without a backward pass after the forward pass, in one position with one tool: {}; their "
        "drift looks like an error of the machine",
        single));
}

void add_notes_on_bar(const mfb::Bar& bar, std::span<const mfb::Measurement> measurements,
                      std::vector<std::string>& notes) {
  constexpr double kNoticed_K = 0.1;
  const bool warm = std::ranges::any_of(measurements, [](const mfb::Measurement& m) {
    return m.temperature_K &&
           std::abs(*m.temperature_K - calib::kReferenceTemperature_K) > kNoticed_K;
  });
  if (!bar.expansion && warm)
    notes.emplace_back(
        "the bar is taken as at 20 C: bar.toml has no alpha_um_per_m_K, although plan.toml states "
        "other temperatures");
  if (bar.covariance_m2.isZero(0.0))
    notes.emplace_back(
        "the bar is taken as exact: bar.toml states no uncertainty of its calibrated points");
}

}  // namespace

Result<calib::mfb::MfbMachine> mfb_machine(const MachineConfig& machine) {
  using calib::Interpolation;
  auto described = otf_machine(machine);
  ABBE_TRY(described);
  const bool linear = machine.interpolation == TableInterpolation::Linear;
  return calib::mfb::MfbMachine{described->chain, std::move(described->nodes),
                                linear ? Interpolation::Linear : Interpolation::NotAKnotCubic};
}

std::vector<std::string> notes_on_inputs(const mfb::Bar& bar, const mfb::Plan& plan,
                                         const MachineConfig& machine) {
  std::vector<std::string> notes;
  if (machine.interpolation == TableInterpolation::Linear)
    notes.emplace_back(
        "the tables are linear between their nodes: for smooth errors set [model] basis = "
        "\"cubic\"");
  add_notes_on_pairs(plan.measurements, notes);
  add_notes_on_bar(bar, plan.measurements, notes);
  return notes;
}

}  // namespace abbe::daemon
