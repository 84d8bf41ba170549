#pragma once
/// The reference data of local calibration with a ball array, in the format of the
/// prototype that computed them (tests/data/evemu, mm).

#include <Eigen/Core>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace abbe::tests::evemu {

inline std::ifstream open_reference(const std::string& name) {
  std::ifstream in(std::filesystem::path(ABBE_TEST_DATA) / "evemu" / name);
  if (!in) {
    throw std::runtime_error("cannot read evemu/" + name);
  }
  return in;
}

inline nlohmann::json reference_json(const std::string& name) {
  auto in = open_reference(name);
  return nlohmann::json::parse(in);
}

/// Cells of every row after the header, as text without quotes.
inline std::vector<std::vector<std::string>> reference_cells(const std::string& name) {
  auto in = open_reference(name);
  std::vector<std::vector<std::string>> rows;
  std::string line;
  std::getline(in, line);

  while (std::getline(in, line)) {
    std::erase(line, '"');
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) {
      rows.back().push_back(cell);
    }
  }

  return rows;
}

inline Eigen::Vector3d vector3(const nlohmann::json& xyz) {
  return Eigen::Vector3d(xyz.at(0).get<double>(), xyz.at(1).get<double>(), xyz.at(2).get<double>());
}

inline Eigen::VectorXd reference_vector(const nlohmann::json& list) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(list.size()));
  for (std::size_t i = 0; i < list.size(); ++i) {
    v(static_cast<Eigen::Index>(i)) = list[i].get<double>();
  }
  return v;
}

}  // namespace abbe::tests::evemu
