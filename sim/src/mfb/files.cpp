#include "abbe/sim/mfb/files.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iterator>

#include "abbe/sim/noise.hpp"
#include "mfb/constants.hpp"
#include "units.hpp"

namespace abbe::sim::mfb {
namespace {

using Eigen::Vector3d;

std::string list(std::span<const double> values, double factor = 1.0) {
  std::vector<double> scaled(values.begin(), values.end());
  for (double& v : scaled) v = factor * v + 0.0;  // 0 instead of -0
  return fmt::format("[{:.15g}]", fmt::join(scaled, ", "));
}
std::string list(const Vector3d& v, double factor = 1.0) {
  return list(std::span(v.data(), 3), factor);
}

std::string pattern_toml(const Pattern& p) {
  std::string text = "\n[pattern]\n";
  const auto row = [&](std::string_view key, const auto& value) {
    fmt::format_to(std::back_inserter(text), "{} = {}\n", key, value);
  };
  row("hole_x_mm", list(p.hole_x_m, kMmPerM));
  row("hole_y_mm", list(p.hole_y_m, kMmPerM));
  row("rod_x_mm", list(p.rod_x_m, kMmPerM));
  row("hole_radius_mm", kMmPerM * p.hole_radius_m);
  row("hole_levels_mm", list(p.hole_levels_m, kMmPerM));
  row("hole_angles_deg", list(p.hole_angles_deg));
  row("rod_radius_mm", kMmPerM * p.rod_radius_m);
  row("rod_sections_mm", list(p.rod_sections_m, kMmPerM));
  row("rod_angles_deg", list(p.rod_angles_deg));
  row("plane_y_mm", kMmPerM * p.plane_y_m);
  row("plane_dx_mm", list(p.plane_dx_m, kMmPerM));
  row("plane_dz_mm", list(p.plane_dz_m, kMmPerM));
  return text;
}

std::string sag_toml(const Sag& sag) {
  constexpr double kPaPerGPa = 1e9;
  return fmt::format(
      "\n[sag]\nbeam_x_mm = {}\nsupports_mm = {}\nsection_yz_mm = {}\n"
      "density_kg_per_m3 = {:.17g}\nyoungs_modulus_GPa = {:.17g}\n",
      list(sag.beam_x_m, kMmPerM), list(sag.supports_m, kMmPerM), list(sag.section_yz_m, kMmPerM),
      sag.density_kg_per_m3, sag.youngs_modulus_Pa / kPaPerGPa);
}

/// The vector with 0 for the coordinates that define the bar frame and have no uncertainty.
Vector3d without_fixed(Vector3d v, std::size_t i, std::size_t holes) {
  if (i == 0) return Vector3d::Zero();
  if (i + 1 == holes) v.tail<2>().setZero();
  return v;
}

}  // namespace

StatedBar calibrated_bar(const TrueBar& bar, const Vector3d& u_m, std::uint64_t seed) {
  StatedBar stated{.pattern = bar.pattern, .O_m = points_of_interest_m(bar)};
  const std::size_t holes = stated.O_m.size();
  for (std::size_t i = 0; i < holes; ++i) {
    stated.u_m.push_back(without_fixed(u_m, i, holes));
    const auto draw = [&](std::size_t k) {
      return gaussian(seed, NoiseStream::BarCalibration, 3 * i + k);
    };
    stated.O_m[i] += stated.u_m[i].cwiseProduct(Vector3d(draw(0), draw(1), draw(2)));
  }
  // These values are only rounding errors of the frame. They must be exactly 0 in the file.
  stated.O_m.front().setZero();
  stated.O_m.back().tail<2>().setZero();
  return stated;
}

StatedBar nominal_bar(const Pattern& pattern, const Vector3d& u_m) {
  StatedBar stated{.pattern = pattern};
  const std::size_t holes = pattern.hole_x_m.size();
  for (std::size_t i = 0; i < holes; ++i) {
    stated.O_m.emplace_back(pattern.hole_x_m[i], pattern.hole_y_m[i], 0.0);
    stated.u_m.push_back(without_fixed(u_m, i, holes));
  }
  return stated;
}

std::string format_bar_toml(const StatedBar& bar) {
  std::string text = fmt::format("[bar]\nname = \"{}\"\n", bar.name);
  const auto out = std::back_inserter(text);
  if (bar.alpha_per_K != 0.0 || bar.u_alpha_per_K != 0.0)
    fmt::format_to(out, "alpha_um_per_m_K = {:.17g}\nu_alpha_um_per_m_K = {:.17g}\n",
                   kUmPerM * bar.alpha_per_K, kUmPerM * bar.u_alpha_per_K);
  text += pattern_toml(bar.pattern);
  if (bar.sag) text += sag_toml(*bar.sag);

  for (std::size_t i = 0; i < bar.O_m.size(); ++i) {
    const Vector3d mm = kMmPerM * bar.O_m[i];
    fmt::format_to(out,
                   "\n[[point]]\nhole = {}\nx_mm = {:.17g}\ny_mm = {:.17g}\nz_mm = {:.17g}\n"
                   "u_um = {}\n",
                   i + 1, mm.x(), mm.y(), mm.z(), list(bar.u_m[i], kUmPerM));
  }
  return text;
}

std::string format_plan_toml(std::span<const Measurement> plan, const ProbedBar& probed,
                             const ProbingOptions& options) {
  std::string text = fmt::format(
      "[plan]\ntip_radius_mm = {:.17g}\nu_temperature_K = {:.17g}\ngravity = {}\n\n"
      "[noise]\nprobe_um = {:.17g}\nmachine_um = {:.17g}\n",
      kMmPerM * options.probe.tip_radius_m, options.temperature.u_K, list(options.gravity),
      kUmPerM * options.probe.noise_m, kUmPerM * options.machine_noise_m);

  for (std::size_t i = 0; i < plan.size(); ++i) {
    const Measurement& m = plan[i];
    fmt::format_to(std::back_inserter(text),
                   "\n[[measurement]]\nname = \"{}\"\nposition = \"{}\"\norigin_mm = {}\n"
                   "bar_x = {}\nbar_z = {}\ntool_offset_mm = {}\npass = \"{}\"\n"
                   "temperature_C = {:.17g}\n",
                   m.name, m.position, list(m.origin_m, kMmPerM), list(m.bar_x), list(m.bar_z),
                   list(m.tool_offset_m, kMmPerM), m.pass == Pass::Forward ? "forward" : "backward",
                   probed.temperature_C[i]);
  }
  return text;
}

std::string format_points_csv(std::span<const Measurement> plan, const ProbedBar& probed) {
  std::string text = "measurement,feature,index,side,k,x_mm,y_mm,z_mm\n";
  for (const Touch& touch : probed.touches) {
    const Vector3d mm = kMmPerM * touch.reading_m;
    fmt::format_to(std::back_inserter(text), "{},{},{:.17g},{:.17g},{:.17g}\n",
                   plan[touch.measurement].name, name(touch.target), mm.x(), mm.y(), mm.z());
  }
  return text;
}

std::string format_machine_toml(const TruthMachine& machine, std::string_view name,
                                double node_spacing_m) {
  std::string chain;
  for (const Axis axis : machine.order)
    chain += fmt::format(" {}", kAxisLetters[static_cast<std::size_t>(axis)]);
  std::string text = fmt::format("[machine]\nname = \"{}\"\nchain = \"[w b{} t]\"\n", name, chain);
  for (const Axis axis : kAxes) {
    const AxisRange& range = machine.axis(axis).range;
    fmt::format_to(std::back_inserter(text),
                   "\n[axes.{}]\nmin_mm = {:.17g}\nmax_mm = {:.17g}\nreference_mm = {:.17g}\n",
                   kAxisLetters[static_cast<std::size_t>(axis)], kMmPerM * range.min_m,
                   kMmPerM * range.max_m, kMmPerM * range.reference_m);
  }
  return text + fmt::format("\n[model]\nbasis = \"cubic\"\nnode_spacing_mm = {:.17g}\n",
                            kMmPerM * node_spacing_m);
}

std::string format_points_of_interest_csv(std::span<const Vector3d> O_m) {
  std::string text = "hole,x_mm,y_mm,z_mm\n";
  for (std::size_t i = 0; i < O_m.size(); ++i) {
    const Vector3d mm = kMmPerM * O_m[i];
    fmt::format_to(std::back_inserter(text), "{},{:.17g},{:.17g},{:.17g}\n", i + 1, mm.x(), mm.y(),
                   mm.z());
  }
  return text;
}

}  // namespace abbe::sim::mfb
