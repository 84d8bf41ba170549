#pragma once
/// What `abbe model eval` prints, as numbers.

#include <sstream>
#include <string>
#include <vector>

namespace abbe::daemon::test {

/// Columns of the rows of `model eval`, without comment and header.
inline std::vector<std::vector<double>> rows_of(const std::string& csv) {
  std::vector<std::vector<double>> rows;
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#' || line[0] == 'x') continue;
    std::vector<double> row;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) row.push_back(std::stod(cell));
    rows.push_back(row);
  }
  return rows;
}

}  // namespace abbe::daemon::test
