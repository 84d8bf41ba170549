// Reads and evaluates csv-grid as a receiver of the format does: by trilinear interpolation.
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "control_tables.hpp"

namespace abbe::daemon {
namespace {

constexpr std::string_view kQuantity = "# quantity = command_correction";
constexpr std::string_view kColumns = "x_mm,y_mm,z_mm,cx_um,cy_um,cz_um,inside";

using GridKey = std::array<double, 3>;

struct CorrectionGrid {
  std::array<std::vector<double>, 3> lines_mm;
  std::map<GridKey, AxisPosition> c_um;
};

std::optional<std::array<double, 7>> grid_row(std::string_view text) {
  std::array<double, 7> row{};
  for (std::size_t i = 0; i < row.size(); ++i) {
    const auto comma = text.find(',');
    const bool last = i + 1 == row.size();
    if ((comma == std::string_view::npos) != last) return std::nullopt;
    const auto value = plain_number(text.substr(0, comma));
    if (!value) return std::nullopt;
    row[i] = *value;
    if (!last) text.remove_prefix(comma + 1);
  }
  return row;
}

/// The index of the lower grid line of the cell, and the position in the cell as a fraction.
std::pair<std::size_t, double> place_in(const std::vector<double>& lines, double q) {
  std::size_t i = 0;
  while (i + 2 < lines.size() && q >= lines[i + 1]) ++i;
  const double w = (q - lines[i]) / (lines[i + 1] - lines[i]);
  return {i, std::clamp(w, 0.0, 1.0)};
}

AxisPosition in_grid(const CorrectionGrid& grid, const AxisPosition& position_mm) {
  const auto [i, u] = place_in(grid.lines_mm[0], position_mm[0]);
  const auto [j, v] = place_in(grid.lines_mm[1], position_mm[1]);
  const auto [k, w] = place_in(grid.lines_mm[2], position_mm[2]);
  AxisPosition c_um{};
  for (const std::size_t x : {i, i + 1}) {
    for (const std::size_t y : {j, j + 1}) {
      for (const std::size_t z : {k, k + 1}) {
        const double share = (x == i ? 1 - u : u) * (y == j ? 1 - v : v) * (z == k ? 1 - w : w);
        const auto& node =
            grid.c_um.at({grid.lines_mm[0][x], grid.lines_mm[1][y], grid.lines_mm[2][z]});
        for (std::size_t a = 0; a < 3; ++a) c_um[a] += share * node[a];
      }
    }
  }
  return c_um;
}

/// Sorts the coordinates. False unless every combination of them is a node.
bool complete(CorrectionGrid& grid) {
  std::size_t nodes = 1;
  for (auto& lines : grid.lines_mm) {
    std::sort(lines.begin(), lines.end());
    lines.erase(std::unique(lines.begin(), lines.end()), lines.end());
    if (lines.size() < 2) return false;
    nodes *= lines.size();
  }
  return nodes == grid.c_um.size();
}

}  // namespace

Result<ControlCorrection> read_csv_grid(const ExportFile& file) {
  CorrectionGrid grid;
  bool quantity = false, header = false;
  for (const TextLine& line : lines_of(file.text, "")) {
    if (line.text == kQuantity) quantity = true;
    if (line.text.empty() || line.text.starts_with('#')) continue;
    if (!header) {
      header = line.text == kColumns && quantity;
      if (!header)
        return at_line(file.name, line.number,
                       fmt::format("must be \"{}\", then the columns {}", kQuantity, kColumns));
      continue;
    }

    const auto row = grid_row(line.text);
    if (!row) return at_line(file.name, line.number, "not seven numbers");
    const auto& r = *row;
    if (!grid.c_um.emplace(GridKey{r[0], r[1], r[2]}, AxisPosition{r[3], r[4], r[5]}).second)
      return at_line(file.name, line.number, "the node is repeated");
    for (std::size_t a = 0; a < 3; ++a) grid.lines_mm[a].push_back(r[a]);
  }
  if (!complete(grid)) return at_line(file.name, 1, "the nodes are not a complete grid");

  return [grid](const AxisPosition& commanded_m, const std::array<int, 3>&) {
    AxisPosition position_mm{};
    for (std::size_t a = 0; a < 3; ++a) position_mm[a] = commanded_m[a] * 1000.0;
    AxisPosition c_m = in_grid(grid, position_mm);
    for (double& c : c_m) c /= 1e6;
    return c_m;
  };
}

}  // namespace abbe::daemon
