#pragma once
/// The reference data of on-the-fly calibration, in the format of the prototype that computed them
/// (own columns, SI). Small files are in tests/data/otf; the two tracker streams and the normal
/// equations are read from ABBE_REF_DIR, by default ../shared/ref beside the repository; tests
/// that need them are skipped without them.

#include <Eigen/Core>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::tests::otf {

using calib::Matrix3;
using calib::Vector3;

inline std::filesystem::path small_file(const std::string& name) {
  return std::filesystem::path(ABBE_TEST_DATA) / "otf" / name;
}

inline std::optional<std::filesystem::path> big_file(const std::string& name) {
  const char* configured = std::getenv("ABBE_REF_DIR");
  const std::filesystem::path root =
      configured != nullptr
          ? std::filesystem::path(configured)
          : std::filesystem::path(ABBE_TEST_DATA) / ".." / ".." / ".." / "shared" / "ref";
  std::filesystem::path file = root / "otf" / name;
  return std::filesystem::exists(file) ? std::optional(file) : std::nullopt;
}

/// Rows of numbers; a first cell that is not a number becomes `label`. Lines that begin with # and
/// the header are skipped.
struct ReferenceRow {
  std::string label;
  std::vector<double> values;
};
inline std::vector<ReferenceRow> read_rows(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) {
    throw std::runtime_error("cannot read " + file.string());
  }

  std::vector<ReferenceRow> rows;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#' || line.rfind("name,", 0) == 0) {
      continue;
    }
    ReferenceRow row;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) {
      if (row.values.empty() && row.label.empty() &&
          std::isalpha(static_cast<unsigned char>(cell[0])) != 0) {
        row.label = cell;
      } else {
        row.values.push_back(std::stod(cell));
      }
    }
    rows.push_back(row);
  }

  return rows;
}

/// Columns of caseA_tables.csv after the name.
enum class TableColumn {
  Node,
  Truth,
  NoiseFreeTwoStep,
  NoiseFreeSimultaneous,
  NoisyTwoStep,
  NoisySimultaneous,
  Sigma,
  OneShot,
  SigmaOneShot
};
inline Eigen::VectorXd case_a_tables(TableColumn column) {
  const std::vector<ReferenceRow> rows = read_rows(small_file("caseA_tables.csv"));
  Eigen::VectorXd U(static_cast<Eigen::Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    U(static_cast<Eigen::Index>(i)) = rows[i].values.at(static_cast<std::size_t>(column));
  }
  return U;
}

inline calib::otf::Machine case_a_machine() {
  calib::otf::Machine machine;
  machine.chain = *calib::KinematicChain::parse("[w X' b Y Z (C1) t]");
  machine.nodes = {*calib::equidistant_nodes(-0.3, 0.3), *calib::equidistant_nodes(-0.25, 0.25),
                   *calib::equidistant_nodes(-0.4, 0.0)};
  machine.target_offset_m = {0.02, -0.015, -0.12};
  return machine;
}

inline calib::otf::Path case_a_path() {
  calib::otf::Path path;
  for (const ReferenceRow& row : read_rows(small_file("path_opt40.csv"))) {
    path.vertices_m.emplace_back(row.values.at(0), row.values.at(1), row.values.at(2));
  }
  return path;
}

/// The result of the prototype's alignment (ref.json, cases.A.*.icp_R, icp_T; noisy rough_R,
/// rough_T).
inline calib::RigidTransform case_a_alignment(bool noisy) {
  calib::RigidTransform T;
  if (noisy) {
    T.R << 0.4533538732467291, -0.8912154787485237, -0.014326061958132425, 0.8906714538356969,
        0.45357810378546853, -0.031165126160273515, 0.03427283084886911, 0.0013690162229929351,
        0.9994115763088731;
    T.t_m = {-0.7501221714358273, -0.6198881373728758, -0.3500589069685657};
  } else {
    T.R << 0.45335387588923015, -0.89121547746623, -0.014326058105861128, 0.8906714522225289,
        0.4535781062809282, -0.0311651359441704, 0.03427283781691099, 0.0013690241951328898,
        0.999411576058997;
    T.t_m = {-0.7501221778816931, -0.6198881341848641, -0.3500589101159056};
  }

  return T;
}
/// The same of the simultaneous estimate (joint_R, joint_T).
inline calib::RigidTransform case_a_simultaneous_alignment(bool noisy) {
  calib::RigidTransform T;
  if (noisy) {
    T.R << 0.4532502113176768, -0.8912675538647216, -0.014366397198909378, 0.8907257279198967,
        0.45347597333471956, -0.031100148387110192, 0.034233369130898174, 0.0012996292258838924,
        0.9994130214289905;
    T.t_m = {-0.7500000554269379, -0.620000004125809, -0.35000001108703693};
  } else {
    T.R << 0.45325017040405585, -0.8912675747646589, -0.014366391398598743, 0.8907257465397566,
        0.453475932160167, -0.0311002154761156, 0.03423342635331344, 0.0012996632605531743,
        0.9994130194246625;
    T.t_m = {-0.7499999999698351, -0.6200000000908623, -0.34999999995036923};
  }

  return T;
}
inline calib::RigidTransform case_a_rough_alignment_noisy() {
  calib::RigidTransform T;
  T.R << 0.4533013396433714, -0.8912461321195609, -0.014079327379091316, 0.8906895179061731,
      0.4535165281382902, -0.031542691664797964, 0.03449750961437886, 0.0017580350718849802,
      0.999403237508811;
  T.t_m = {-0.7501072651963406, -0.6199457381258993, -0.35015620603146763};
  return T;
}

struct ReferenceSegments {
  std::vector<Vector3> means_tracker_m;
  std::vector<std::size_t> leg;
  std::vector<bool> used;
};
inline ReferenceSegments case_a_segments() {
  ReferenceSegments segments;
  for (const ReferenceRow& row : read_rows(small_file("caseA_blocks_noisy.csv"))) {
    segments.means_tracker_m.emplace_back(row.values.at(0), row.values.at(1), row.values.at(2));
    segments.leg.push_back(static_cast<std::size_t>(row.values.at(3)));
    segments.used.push_back(row.values.at(4) != 0);
  }
  return segments;
}

template <class T>
std::vector<T> read_binary(const std::filesystem::path& file) {
  std::vector<T> values(std::filesystem::file_size(file) / sizeof(T));
  std::ifstream in(file, std::ios::binary);
  in.read(reinterpret_cast<char*>(values.data()),
          static_cast<std::streamsize>(values.size() * sizeof(T)));
  return values;
}

/// Samples of caseA_stream_*.i32: r 1e-8 m, az and el 2e-9 rad, 500 Hz.
inline std::vector<calib::otf::TrackerObservation> read_stream(const std::filesystem::path& file) {
  const std::vector<std::int32_t> counts = read_binary<std::int32_t>(file);
  std::vector<calib::otf::TrackerObservation> samples(counts.size() / 3);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].time_s = static_cast<double>(i) / 500.0;
    samples[i].p_tracker_m = calib::from_spherical(counts[3 * i] * 1e-8, counts[3 * i + 1] * 2e-9,
                                                   counts[3 * i + 2] * 2e-9);
  }
  return samples;
}

}  // namespace abbe::tests::otf
