/// Requirement: `abbe identify otf` takes at most 3 s of wall time for the 488,664 samples of
/// reference case A from CSV, including process start and parsing. The program converts the
/// reference stream (int32 triples range, azimuth, elevation) to tracker.csv once, runs the built
/// `abbe` as a process, and compares the model with the true tables. Build type Release.
/// ABBE_REF_DIR names the folder of the reference data, by default beside the clone.

#include <fmt/format.h>

#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/model/model_datum.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tables/input_files.hpp"
#include "config_tables.hpp"

namespace {

namespace fs = std::filesystem;
using namespace abbe;
using Clock = std::chrono::steady_clock;

constexpr double kAskedSeconds = 3.0;
constexpr int kRuns = 5;

fs::path reference_folder() {
  const char* const given = std::getenv("ABBE_REF_DIR");
  return fs::path(given != nullptr ? given : ABBE_SOURCE_DIR "/../shared/ref") / "otf";
}

/// Units of the stream: 1e-8 m, 2e-9 rad; 500 Hz.
void convert_stream(const fs::path& stream, const fs::path& csv) {
  std::ifstream in(stream, std::ios::binary);
  std::ofstream out(csv, std::ios::binary);
  std::string text = "time_s,range_mm,azimuth_rad,elevation_rad\n";
  std::array<std::int32_t, 3> counts{};
  for (int i = 0; in.read(reinterpret_cast<char*>(counts.data()), sizeof counts); ++i)
    fmt::format_to(std::back_inserter(text), "{:.3f},{:.5f},{:.9f},{:.9f}\n", i / 500.0,
                   counts[0] * 1e-5, counts[1] * 2e-9, counts[2] * 2e-9);
  out << text;
}

void convert_path(const fs::path& path_m, const fs::path& csv) {
  std::ifstream in(path_m);
  std::ofstream out(csv);
  out << "x_mm,y_mm,z_mm\n";
  for (std::string line; std::getline(in, line);) {
    double x = 0, y = 0, z = 0;
    if (std::sscanf(line.c_str(), "%lf,%lf,%lf", &x, &y, &z) == 3)
      out << fmt::format("{},{},{}\n", x * 1e3, y * 1e3, z * 1e3);
  }
}

void write_machine(const fs::path& toml) {
  std::ofstream(toml) << to_toml(config_tables::case_a())
                      << "[tracker]\nsigma_range_um = 2\nsigma_angle_urad = 3\n"
                         "[gate]\naccept = [\"path-orientation\"]\n";
}

/// The true tables as a parameter vector in datum G1.
Eigen::VectorXd true_parameters(const calib::ParameterLayout& layout,
                                const calib::Vector3& tool_m) {
  std::map<std::string, std::vector<double>> tables;
  std::ifstream in(ABBE_TEST_DATA "/otf/caseA_tables.csv");
  for (std::string line; std::getline(in, line);) {
    std::istringstream cells(line);
    std::string name, node, value;
    std::getline(cells, name, ',');
    std::getline(cells, node, ',');
    std::getline(cells, value, ',');
    if (name != "name") tables[name].push_back(std::stod(value));
  }

  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.fit_size()));
  for (const auto& table : layout.tables()) {
    const auto& values = tables.at(name(table.motion));
    for (std::size_t i = 0; i < values.size(); ++i)
      U[static_cast<Eigen::Index>(table.offset + i)] = values[i];
  }

  const auto squareness = static_cast<Eigen::Index>(layout.squareness_offset());
  U[squareness] = tables.at("A0Z")[0];
  U[squareness + 1] = tables.at("B0Z")[0];
  U[squareness + 2] = tables.at("C0Y")[0];

  return calib::to_datum(calib::ModelDatum::G1, layout, std::array{tool_m}, U).value();
}

/// Mean absolute difference between the model and the true tables in G1; infinite without a model.
double print_errors(const fs::path& model_json) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const auto document = daemon::read_model(model_json);
  if (!document) return kNone;
  const auto& model = document->model;
  const calib::Vector3 tool_m = model.tool_offsets_m().front();
  const auto U = true_parameters(model.tables()->layout(), tool_m);
  std::vector<calib::Vector3> points_m, difference_m, true_m;

  for (const auto& q_m : calib::tensor_grid(model.nodes())) {
    true_m.push_back(calib::volumetric_error(
        model.tables()->layout(), {U.data(), model.tables()->layout().model_size()}, q_m, tool_m));
    difference_m.push_back(model.V_at(q_m, tool_m) - true_m.back());
    points_m.push_back(q_m + tool_m);
  }

  const auto difference = calib::rigid_free(points_m, difference_m);
  if (!difference) return kNone;
  fmt::print(
      "  true error {:.1f} um mean; model wrong by {:.4f} um MAE in G1, {:.4f} um after a rigid "
      "motion\n",
      calib::vector_statistics(true_m).mean_m * 1e6, difference->as_stated.mean_m * 1e6,
      difference->rigid_free.mean_m * 1e6);

  return difference->as_stated.mean_m;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

template <class Work>
double median_seconds(Work work) {
  std::vector<double> seconds;
  for (int i = 0; i < kRuns; ++i) {
    const auto begin = Clock::now();
    work();
    seconds.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
  }
  return median(seconds);
}

bool measure(const std::string& kind, double asked_mae_m, const fs::path& folder) {
  const auto stream = reference_folder() / fmt::format("caseA_stream_{}.i32", kind);
  if (!fs::exists(stream)) {
    fmt::print("{}: not there, nothing measured (set ABBE_REF_DIR)\n", stream.string());
    return false;
  }

  convert_stream(stream, folder / "tracker.csv");
  const auto command =
      fmt::format("'{}' identify otf --machine '{}' --path '{}' --tracker '{}' -o '{}' >/dev/null",
                  ABBE_PROGRAM, (folder / "machine.toml").string(), (folder / "path.csv").string(),
                  (folder / "tracker.csv").string(), (folder / "out").string());
  int failed = 0;
  const double whole_s = median_seconds([&] { failed |= std::system(command.c_str()); });
  std::size_t points = 0;

  const double parse_s = median_seconds([&] {
    if (const auto tracker = daemon::read_tracker_csv(folder / "tracker.csv"))
      points = tracker->points.size();
  });

  fmt::print(
      "case A {}: {} samples, {:.1f} MB: {:.2f} s wall (asked {:.1f}), of it {:.2f} s reading the "
      "tracker\n",
      kind, points, static_cast<double>(fs::file_size(folder / "tracker.csv")) / 1e6, whole_s,
      kAskedSeconds, parse_s);
  const double mae_m = print_errors(folder / "out" / "model.json");
  fmt::print("  asked at most {:.3f} um MAE in G1: {}\n", asked_mae_m * 1e6,
             mae_m <= asked_mae_m ? "yes" : "no");

  return failed == 0 && whole_s <= kAskedSeconds && mae_m <= asked_mae_m;
}

}  // namespace

int main() {
  const auto folder = fs::temp_directory_path() / fmt::format("abbe_identify_{}", ::getpid());
  fs::create_directories(folder);
  convert_path(ABBE_TEST_DATA "/otf/path_opt40.csv", folder / "path.csv");
  write_machine(folder / "machine.toml");
  const bool noisy = measure("noisy", 0.105e-6, folder);
  const bool noise_free = measure("noisefree", 0.026e-6, folder);
  fs::remove_all(folder);
  return noisy && noise_free ? 0 : 1;
}
