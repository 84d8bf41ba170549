#pragma once
/// Reference data of the Multi-Feature Bar in tests/data/mfb, computed by an independent prototype.
/// Files are in mm and um; what is returned is in m.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/calib/mfb/run/features.hpp"

namespace abbe::tests::mfb {

using calib::Vector3;
using nlohmann::json;

inline std::ifstream open_reference(const std::string& name) {
  std::ifstream in(std::filesystem::path(ABBE_TEST_DATA) / "mfb" / name);
  EXPECT_TRUE(in) << name;
  return in;
}

inline json reference(const std::string& name) {
  auto in = open_reference(name);
  return json::parse(in);
}

/// Three numbers, multiplied by `unit`.
inline Vector3 vector_in(const json& values, double unit) {
  return unit * Vector3(values.at(0).get<double>(), values.at(1), values.at(2));
}

inline std::vector<Vector3> points_in(const json& points, double unit) {
  std::vector<Vector3> all;
  for (const json& p : points) {
    all.push_back(vector_in(p, unit));
  }
  return all;
}

inline constexpr double kMm = 1e-3, kUm = 1e-6;

inline calib::mfb::BarTouches touches_of(const json& points) {
  calib::mfb::BarTouches touches;
  for (const json& hole : points.at("holes")) {
    touches.holes_m.push_back(points_in(hole, kMm));
  }
  for (const json& rod : points.at("rods")) {
    touches.rods_m.push_back(points_in(rod, kMm));
  }
  for (const json& pair : points.at("planes")) {
    touches.planes_m.push_back({points_in(pair.at(0), kMm), points_in(pair.at(1), kMm)});
  }
  return touches;
}

/// The touches of the nominal bar, at most 0.02 mm from it; its axes are those of the frame.
inline calib::mfb::BarTouches nominal_touches() {
  return touches_of(reference("nominal_points.json"));
}

}  // namespace abbe::tests::mfb
