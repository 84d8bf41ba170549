#pragma once
/// A folder with a model and points of a tracker, in which `abbe verify` runs.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "abbe/calib/evemu/solve/solve.hpp"
#include "abbe/methods/evemu/document.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe_command.hpp"
#include "evemu_study.hpp"

namespace abbe::daemon {

/// Identified once: it takes seconds, under ThreadSanitizer minutes.
inline const std::string& ball_array_document() {
  static const std::string text = [] {
    const auto solution = *calib::evemu::solve(tests::evemu::simulated(
        tests::evemu::reference_layout(), tests::evemu::table3_machine(), {8e-6, 0.0}, 1));
    Config config;
    config.machine.name = "weak portal";
    return to_json(evemu_document(solution, config, {}, {}));
  }();
  return text;
}

/// Every 100, 100 and 20 mm, as in [Li OMM] section 5.4, seen from the tracker.
inline std::vector<calib::verify::MeasuredPoint> tracker_points(const tests::evemu::Field& V) {
  const calib::RigidTransform T_tracker_machine{
      Eigen::AngleAxisd(1.1, calib::Vector3(0.2, 0.1, 1.0).normalized()).toRotationMatrix(),
      calib::Vector3(3.0, -1.0, 0.4)};
  std::vector<calib::verify::MeasuredPoint> points;
  for (int x = -100; x <= 600; x += 100)
    for (int y = -100; y <= 400; y += 100)
      for (int z = 0; z <= 100; z += 20) {
        const calib::Vector3 q(1e-3 * x, 1e-3 * y, 1e-3 * z);
        points.push_back({q, T_tracker_machine * (q + V(q))});
      }
  return points;
}

class VerifyCli : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_);
    write("model.json", ball_array_document());
    write("verification.csv", to_verification_csv(tracker_points(tests::evemu::table3_machine())));
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  test::Ran abbe(const std::string& arguments) const { return test::run_abbe(folder_, arguments); }

  std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) / fmt::format("verify_cli_{}", ::getpid());
};

/// A grid in the volume of the model, measured without noise.
inline std::vector<calib::verify::MeasuredPoint> points_of(const ModelDocument& document) {
  std::vector<calib::verify::MeasuredPoint> points;
  const auto tool = document.model.tool_offsets_m().front();
  for (int i = 0; i < 343; ++i) {
    const calib::Vector3 q(-0.3 + 0.1 * (i % 7), -0.3 + 0.1 * (i / 7 % 7), -0.4 + 0.05 * (i / 49));
    points.push_back({q, q + tool + document.model.V_at(q, tool)});
  }
  return points;
}

}  // namespace abbe::daemon
