// Writes bar.toml and gauge.toml.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numbers>

#include "abbe/base/json_text.hpp"
#include "abbe/base/units.hpp"
#include "abbe/tables/gauge_file.hpp"

namespace abbe::daemon {
namespace {

template <class Values>
std::string toml_list(const Values& values, double factor) {
  std::vector<double> scaled;
  for (const double v : values) scaled.push_back(factor * v);
  return fmt::format("[{:.15g}]", fmt::join(scaled, ", "));
}

std::string bar_pattern_toml(const calib::mfb::TouchPattern& p) {
  constexpr double kDegPerRad = 180.0 / std::numbers::pi;
  return fmt::format(
      "\n[pattern]\nhole_x_mm = {}\nhole_y_mm = {}\nrod_x_mm = {}\n"
      "hole_radius_mm = {:.15g}\nhole_levels_mm = {}\nhole_angles_deg = {}\n"
      "rod_radius_mm = {:.15g}\nrod_sections_mm = {}\nrod_angles_deg = {}\n"
      "plane_y_mm = {:.15g}\nplane_dx_mm = {}\nplane_dz_mm = {}\n",
      toml_list(p.hole_x_m, kMmPerM), toml_list(p.hole_y_m, kMmPerM), toml_list(p.rod_x_m, kMmPerM),
      kMmPerM * p.hole_radius_m, toml_list(p.hole_levels_m, kMmPerM),
      toml_list(p.hole_angles_rad, kDegPerRad), kMmPerM * p.rod_radius_m,
      toml_list(p.rod_sections_m, kMmPerM), toml_list(p.rod_angles_rad, kDegPerRad),
      kMmPerM * p.plane_y_m, toml_list(p.plane_dx_m, kMmPerM), toml_list(p.plane_dz_m, kMmPerM));
}

std::string bar_sag_toml(const calib::mfb::Sag& sag) {
  constexpr double kGiga = 1e-9;
  return fmt::format(
      "\n[sag]\nbeam_x_mm = {}\nsupports_mm = {}\nsection_yz_mm = {}\n"
      "density_kg_per_m3 = {:.15g}\nyoungs_modulus_GPa = {:.15g}\n",
      toml_list(sag.beam_x_m, kMmPerM), toml_list(sag.supports_m, kMmPerM),
      toml_list(sag.section_yz_m, kMmPerM), sag.density_kg_per_m3, kGiga * sag.youngs_modulus_Pa);
}

/// The covariance with one row of the matrix per line. It is symmetric to the last digit.
std::string covariance_toml(const Eigen::MatrixXd& covariance_m2) {
  std::string text = "\n[calibration]\ncovariance_um2 = [\n";
  for (Eigen::Index i = 0; i < covariance_m2.rows(); ++i) {
    std::vector<double> row;
    for (Eigen::Index k = 0; k < covariance_m2.cols(); ++k)
      row.push_back(kUmPerM * kUmPerM * covariance_m2(std::min(i, k), std::max(i, k)));
    fmt::format_to(std::back_inserter(text), "  [{:.12g}],\n", fmt::join(row, ", "));
  }
  return text + "]\n";
}

}  // namespace

std::string bar_toml(const calib::mfb::Bar& bar, std::string_view comment) {
  std::string text =
      fmt::format("{}[bar]\nname = {}\n", comment, json_text(nlohmann::json(bar.name)));
  const auto out = std::back_inserter(text);
  if (bar.expansion)
    fmt::format_to(out, "alpha_um_per_m_K = {:.15g}\nu_alpha_um_per_m_K = {:.15g}\n",
                   kUmPerM * bar.expansion->alpha_per_K, kUmPerM * bar.expansion->u_alpha_per_K);
  text += bar_pattern_toml(bar.pattern);
  if (bar.sag) text += bar_sag_toml(*bar.sag);
  text += covariance_toml(bar.covariance_m2);

  for (std::size_t i = 0; i < bar.O_m.size(); ++i) {
    const calib::Vector3 mm = kMmPerM * bar.O_m[i];
    fmt::format_to(out, "\n[[point]]\nhole = {}\nx_mm = {:.17g}\ny_mm = {:.17g}\nz_mm = {:.17g}\n",
                   i + 1, mm.x(), mm.y(), mm.z());
  }
  return text;
}

std::string gauge_toml(const calib::mfb::StepGauge& gauge, std::string_view comment) {
  std::string text = fmt::format(
      "{}[gauge]\nname = {}\norigin_mm = {}\ntool_offset_mm = {}\nu_um = {:.15g}\n"
      "u_um_per_m = {:.15g}\ntemperature_C = {:.15g}\nu_temperature_K = {:.15g}\n",
      comment, json_text(nlohmann::json(gauge.name)), toml_list(gauge.origin_m, kMmPerM),
      toml_list(gauge.tool_offset_m, kMmPerM), kUmPerM * gauge.u_m, kUmPerM * gauge.u_per_m,
      gauge.temperature_K - kZeroCelsius_K, gauge.u_temperature_K);
  const auto out = std::back_inserter(text);
  if (gauge.expansion)
    fmt::format_to(out, "alpha_um_per_m_K = {:.15g}\nu_alpha_um_per_m_K = {:.15g}\n",
                   kUmPerM * gauge.expansion->alpha_per_K,
                   kUmPerM * gauge.expansion->u_alpha_per_K);
  if (gauge.u_rotation_rad)
    fmt::format_to(out, "u_rotation_urad = {:.15g}\n", kUmPerM * *gauge.u_rotation_rad);
  if (gauge.u_alignment_rad)
    fmt::format_to(out, "u_alignment_mrad = {:.15g}\n", 1e3 * *gauge.u_alignment_rad);
  for (const calib::mfb::GaugeFace& face : gauge.faces) {
    std::vector<std::string> readings_mm;
    for (const calib::Vector3& q_m : face.readings_m)
      readings_mm.push_back(toml_list(q_m, kMmPerM));
    fmt::format_to(out, "\n[[step]]\ndistance_mm = {:.15g}\nreadings_mm = [{}]\n",
                   kMmPerM * face.distance_m, fmt::join(readings_mm, ", "));
  }
  return text;
}

}  // namespace abbe::daemon
