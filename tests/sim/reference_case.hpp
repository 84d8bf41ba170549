#pragma once
/// Case A of the reference data, read for the tests of the simulator: nodes and true values of 14
/// tables and 3 squareness errors.

#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim::test {

inline std::vector<std::vector<std::string>> read_rows(const std::string& path) {
  std::vector<std::vector<std::string>> rows;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::vector<std::string> cells;
    std::istringstream split(line);
    for (std::string cell; std::getline(split, cell, ',');) cells.push_back(cell);
    rows.push_back(cells);
  }
  return rows;
}

inline TruthMachine reference_machine(Shape shape) {
  TruthMachine machine;
  machine.target_offset_m = {0.02, -0.015, -0.12};
  std::map<std::string, std::pair<std::vector<double>, std::vector<double>>> tables;

  for (const auto& row : read_rows(std::string(ABBE_TEST_DATA) + "/otf/caseA_tables.csv")) {
    if (row[0] == "name") continue;
    tables[row[0]].first.push_back(row[1].empty() ? 0.0 : std::stod(row[1]));
    tables[row[0]].second.push_back(std::stod(row[2]));
  }

  for (const Axis axis : kAxes) {
    for (std::size_t m = 0; m < kMotions; ++m) {
      const auto table = tables.find(motion_name(m, axis));
      if (table == tables.end()) continue;
      machine.axis(axis).error[m] = ErrorFunction(table->second.first, table->second.second, shape);
    }
  }

  machine.squareness = {tables.at("A0Z").second[0], tables.at("B0Z").second[0],
                        tables.at("C0Y").second[0]};
  machine.axis(Axis::X).range = {-0.3, 0.3, 0.0};
  machine.axis(Axis::Y).range = {-0.25, 0.25, 0.0};
  machine.axis(Axis::Z).range = {-0.4, 0.0, 0.0};

  return machine;
}

}  // namespace abbe::sim::test
