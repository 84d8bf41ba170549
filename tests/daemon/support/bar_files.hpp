#pragma once
/// The files of a calibration with a Multi-Feature Bar: a small bar of three holes, and the case
/// "full" of the reference data of the identification.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <sstream>
#include <string>

#include "mfb_reference.hpp"

namespace abbe::daemon::test {

/// [pattern] of the bars, without hole_x_mm, hole_y_mm and rod_x_mm.
inline constexpr const char* kTouchedPlaces = R"(hole_radius_mm = 8
hole_levels_mm = [-6, 6]
hole_angles_deg = [45, 135, 225, 315]
rod_radius_mm = 5
rod_sections_mm = [-12, -4, 4, 12]
rod_angles_deg = [-30, 90, 210]
plane_y_mm = 18
plane_dx_mm = [-6, 6]
plane_dz_mm = [-4, 4]
)";

inline std::string small_bar_toml() {
  return fmt::format(R"([bar]
name = "short bar"
[pattern]
hole_x_mm = [0, 50, 100]
hole_y_mm = [0, 1, 0]
rod_x_mm = [25, 75]
{}[[point]]
hole = 1
x_mm = 0
y_mm = 0
z_mm = 0
u_um = [0, 0, 0]
[[point]]
hole = 2
x_mm = 49.9902
y_mm = 1.0177
z_mm = -0.0022
u_um = [0.2, 0.35, 0.35]
[[point]]
hole = 3
x_mm = 99.9854
y_mm = 0
z_mm = 0
u_um = [0.2, 0, 0]
)",
                     kTouchedPlaces);
}

inline std::string small_plan_toml() {
  return R"([plan]
tip_radius_mm = 1.5
[noise]
probe_um = 0.125
machine_um = 0.25
[[measurement]]
name = "X1"
position = "P1"
origin_mm = [0, 100, 0]
bar_x = [1, 0, 0]
bar_z = [0, 0, 1]
tool_offset_mm = [0, 0, -150]
[[measurement]]
name = "X1 back"
position = "P1"
origin_mm = [0, 100, 0]
bar_x = [2, 0, 0]
bar_z = [0, 0, 3]
tool_offset_mm = [0, 0, -150]
pass = "backward"
)";
}

inline std::string small_points_csv() {
  return R"(measurement,feature,index,side,k,x_mm,y_mm,z_mm
X1,hole,1,,0,4.6,104.6,144
X1,rod,1,,0,30.6,88.0,146.75
X1,plane,1,L,0,19,119.5,146
X1,plane,2,R,3,81,80.5,154
X1 back,hole,3,,7,104.6,95.4,156
X1 back,hole,1,,0,4.6,104.6,144
)";
}

inline const tests::mfb::json& reference_case(const std::string& name) {
  static const tests::mfb::json all = tests::mfb::reference("identification_reference.json");
  for (const auto& one : all.at("cases")) {
    if (one.at("name") == name) return one;
  }
  throw std::runtime_error("no case " + name);
}

/// The machine of the reference data: 12 nodes, 50 mm apart, on every axis.
inline std::string reference_machine_toml() {
  std::string text =
      "[machine]\nname = \"shop-3\"\nchain = \"[w X' b Y Z (C1) t]\"\n"
      "[model]\nbasis = \"cubic\"\nnode_spacing_mm = 50\n";
  for (const char axis : {'X', 'Y', 'Z'})
    text += fmt::format("[axes.{}]\nmin_mm = 0\nmax_mm = 550\n", axis);
  return text;
}

/// Uncertainties of [spec 5.3]: 0.2 um along the bar, 0.35 um across it.
inline std::string reference_bar_toml() {
  std::string text = fmt::format(
      "[bar]\nname = \"reference\"\n[pattern]\n"
      "hole_x_mm = [0, 50, 100, 150, 200, 250, 300, 350, 400, 450, 500, 550]\n"
      "hole_y_mm = [0, 0, 1, 0, 1, 0, 0, 0, 0, 0, 0, 0]\n"
      "rod_x_mm = [25, 75, 125, 175, 225, 275, 325, 375, 425, 475, 525]\n{}",
      kTouchedPlaces);
  const auto& points = reference_case("full").at("x_cal");
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool first = i == 0, last = i + 1 == points.size();
    constexpr double kRounding_mm = 1e-12;
    text += fmt::format("[[point]]\nhole = {}\n", i + 1);
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = points[i][c];
      text +=
          fmt::format("{}_mm = {:.17g}\n", "xyz"[c], std::abs(value) < kRounding_mm ? 0 : value);
    }
    text += fmt::format("u_um = [{}, {}, {}]\n", first ? 0.0 : 0.2, first || last ? 0.0 : 0.35,
                        first || last ? 0.0 : 0.35);
  }
  return text;
}

/// Tip radius 0, as the reference data were made; t = -J.
inline std::string reference_plan_toml() {
  std::string text = "[plan]\ntip_radius_mm = 0\n[noise]\nprobe_um = 0.125\nmachine_um = 0.25\n";
  for (const auto& m : reference_case("full").at("plan")) {
    const auto column = [&](std::size_t c) {
      return fmt::format("[{:.17g}, {:.17g}, {:.17g}]", m["R"][0][c].get<double>(),
                         m["R"][1][c].get<double>(), m["R"][2][c].get<double>());
    };
    text += fmt::format(
        "[[measurement]]\nname = \"{}\"\nposition = \"{}\"\norigin_mm = {}\nbar_x = {}\n"
        "bar_z = {}\ntool_offset_mm = [{}, {}, {}]\n",
        m["name"].get<std::string>(), m["pos"].get<std::string>(), m["p"].dump(), column(0),
        column(2), -m["J"][0].get<double>(), -m["J"][1].get<double>(), -m["J"][2].get<double>());
  }
  return text;
}

/// The probed points of the case "full" under the header of the program.
inline std::string reference_points_csv() {
  std::ostringstream text;
  auto in = tests::mfb::open_reference("probed_points_full.csv");
  std::string header;
  std::getline(in, header);
  EXPECT_TRUE(header.starts_with("measurement,feature,index,side,k,X,Y,Z")) << header;
  text << "measurement,feature,index,side,k,x_mm,y_mm,z_mm\n" << in.rdbuf();
  return text.str();
}

}  // namespace abbe::daemon::test
