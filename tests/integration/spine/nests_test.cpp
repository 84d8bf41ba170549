/// A calibration with a tracker that drifts and visits reference nests between the legs.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "abbe/recording/recording_reader.hpp"
#include "abbe/sim/tracker_model.hpp"
#include "config_tables.hpp"
#include "spine.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;

class NestRun : public Spine {
 protected:
  NestRun() {
    const sim::TrackerModel tracker{.position_m = {-0.35, -0.32, -0.15},  // as in spine.cpp
                                    .rotation_rad = {0.0013, -0.0342, 1.1003}};
    // Machine coordinates, beside the travel of the target.
    for (const Eigen::Vector3d& p_m :
         {Eigen::Vector3d(-0.20, -0.18, -0.33), Eigen::Vector3d(0.24, -0.15, -0.08),
          Eigen::Vector3d(0.18, 0.20, -0.33)})
      nests_m_.push_back(sim::R_machine_tracker(tracker).transpose() * (p_m - tracker.position_m));

    std::string text = text_of(file("sim.toml")) +
                       "drift_um = [40, -40, 40]\n"
                       "nest_every_s = 12\nnest_stay_s = 0.8\nnest_move_s = 0.4\n";
    for (const Eigen::Vector3d& p_m : nests_m_) text += "[[sim.tracker.nest]]\n" + position(p_m);
    write("sim.toml", text);
    write_path("path.csv", path());
  }

  static std::string position(const Eigen::Vector3d& p_m) {
    return fmt::format("position_mm = [{}, {}, {}]\n", 1e3 * p_m.x(), 1e3 * p_m.y(), 1e3 * p_m.z());
  }

  /// The nests as an operator knows them: 2 mm from where they are.
  [[nodiscard]] std::string nest_tables() const {
    std::string text;
    for (std::size_t i = 0; i < nests_m_.size(); ++i)
      text += fmt::format("[[tracker.nest]]\nname = \"{}\"\n", i) +
              position(nests_m_[i] + Eigen::Vector3d(2e-3, 0.0, 0.0));
    return text;
  }

  void write_configuration_with(const std::string& nests) const {
    write_configuration_of(tracker_table() + nests +
                           to_toml(config_tables::Encoder{
                               .peer_port = can_port_, .sync_period_us = 10'000, .step_nm = 10}));
  }

  /// The points of the recording without those at the nests.
  void write_points_of_machine(const std::string& name) const {
    const auto recording = daemon::RecordingReader::open(recordings().front());
    ASSERT_TRUE(recording);
    std::string text = "time_s,tracker_x_mm,tracker_y_mm,tracker_z_mm\n";
    daemon::RecordingSink sink;
    sink.tracker_point = [&](const protocol::TrackerPoint& point, std::string_view) {
      const Eigen::Vector3d p_m = Eigen::Vector3d::Map(point.p_tracker_m.data());
      const bool at_nest = std::any_of(nests_m_.begin(), nests_m_.end(), [&](const auto& nest_m) {
        return (p_m - nest_m).norm() < 10e-3;
      });
      if (!at_nest)
        text +=
            fmt::format("{},{},{},{}\n",
                        std::chrono::duration<double>(point.device_time.time_since_epoch()).count(),
                        1e3 * p_m.x(), 1e3 * p_m.y(), 1e3 * p_m.z());
    };
    EXPECT_EQ(recording->read(sink), 0u);
    write(name, text);
  }

  /// V on a grid, as points that a perfect tracker in the frame of the machine measures.
  void write_truth(const std::string& name) const {
    const auto truth =
        run({ABBE_SIM_PROGRAM, "truth", "--config", file("sim.toml"), "--grid", "5", "5", "5"});
    ASSERT_EQ(truth.code, 0) << truth.err;
    std::string points = "x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm\n";
    std::istringstream lines(truth.out);
    std::string line;
    std::getline(lines, line);  // header
    while (std::getline(lines, line)) {
      std::array<double, 6> v{};
      std::istringstream cells(line);
      for (double& value : v) {
        cells >> value;
        cells.ignore();
      }
      points += fmt::format("{},{},{},{},{},{}\n", v[0], v[1], v[2], v[0] + 1e-3 * v[3],
                            v[1] + 1e-3 * v[4], v[2] + 1e-3 * v[5]);
    }
    write(name, points);
  }

  [[nodiscard]] json identified(std::vector<std::string> options) const {
    options.insert(options.begin(), {ABBE_PROGRAM, "identify", "otf", "--json"});
    const auto ran = run(options);
    const json said = json::parse(ran.out, nullptr, false);
    EXPECT_TRUE(said.is_object()) << ran.out << ran.err;
    return said;
  }

  [[nodiscard]] double mean_error_um(const std::string& model) const {
    const auto verified =
        run({ABBE_PROGRAM, "verify", file(model), "--points", file("points.csv"), "--json"});
    const json said = json::parse(verified.out, nullptr, false);
    EXPECT_TRUE(said.is_object()) << verified.out << verified.err;
    return said.is_object() ? said["after"]["mean_um"].get<double>() : 0.0;
  }

  std::vector<Eigen::Vector3d> nests_m_;  ///< tracker frame
};

TEST_F(NestRun, GivesTheModelOfItsRecordingWithoutTheDrift) {
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  hold_simulator();
  write_configuration_with(nest_tables());
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const auto calibrated = calibrate("path.csv");
  ASSERT_EQ(calibrated.code, 0) << calibrated.out << calibrated.err;
  EXPECT_TRUE(eventually([&] { return status()["model"]["state"] == "ACTIVE"; }));
  const json live = status()["model"];
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();

  const json again = identified({"--recording", recordings().front(), "-o", file("with")});
  EXPECT_EQ(again["id"], live["id"]);
  // From the first visit on, which is early in the run: at most 40 um along each of three axes.
  double squares = 0.0;
  for (const json& um : again["tracker_drift"]["largest_um"])
    squares += um.get<double>() * um.get<double>();
  EXPECT_LT(std::sqrt(squares), 1.05 * 40.0 * std::sqrt(3.0));
  EXPECT_GT(std::sqrt(squares), 0.85 * 40.0 * std::sqrt(3.0));

  write_truth("points.csv");
  write_points_of_machine("tracker.csv");
  write_configuration_with("");
  const json without = identified({"--machine", file("abbed.toml"), "--path", file("path.csv"),
                                   "--tracker", file("tracker.csv"), "-o", file("without")});
  EXPECT_FALSE(without.contains("tracker_drift"));
  EXPECT_LT(mean_error_um("with/model.json"), 0.5 * mean_error_um("without/model.json"));
}

}  // namespace
}  // namespace abbe::test
