#include "abbe/dds/grid_comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string>
#include <string_view>

namespace abbe::dds {
namespace {

using calib::Vector3;
using daemon::ErrorCode;
using daemon::Result;

constexpr double kMillimetre = 1e-3;
constexpr double kMicrometre = 1e-6;
constexpr std::array<std::string_view, 6> kColumns{"x_mm", "y_mm", "z_mm", "ex_um", "ey_um", "ez_um"};

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    cells.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return cells;
}

/// Index of the cell, and how much of it lies behind; false outside.
bool locate(const std::vector<double>& nodes, double x, std::size_t& cell, double& fraction) {
  if (nodes.size() < 2 || x < nodes.front() || x > nodes.back()) return false;
  const auto above = std::upper_bound(nodes.begin() + 1, nodes.end() - 1, x);
  cell = static_cast<std::size_t>(above - nodes.begin()) - 1;
  fraction = (x - nodes[cell]) / (nodes[cell + 1] - nodes[cell]);
  return true;
}

Vector3 vector_of(const std::array<double, 3>& a) {
  return {a[0], a[1], a[2]};
}

}  // namespace

Result<std::vector<KnownError>> read_known_errors(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) return daemon::fail(ErrorCode::BadInput, file.string() + ": cannot be read");
  std::vector<KnownError> known;
  std::array<std::size_t, kColumns.size()> columns{};
  bool has_header = false;
  std::size_t number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    if (line.empty() || line[0] == '#') continue;
    if (line.back() == '\r') line.pop_back();
    const auto cells = cells_of(line);
    std::array<double, kColumns.size()> row{};
    for (std::size_t c = 0; c < kColumns.size(); ++c) {
      const auto refuse = [&](std::string_view what) {
        return daemon::fail(ErrorCode::BadInput,
                            fmt::format("{}:{}: {}: {}", file.string(), number, kColumns[c], what));
      };
      if (!has_header) {
        const auto found = std::find(cells.begin(), cells.end(), kColumns[c]);
        if (found == cells.end()) return refuse("column is missing");
        columns[c] = static_cast<std::size_t>(found - cells.begin());
        continue;
      }
      if (columns[c] >= cells.size()) return refuse("the row is too short");
      const auto cell = cells[columns[c]];
      const auto parsed = std::from_chars(cell.data(), cell.data() + cell.size(), row[c]);
      if (parsed.ec != std::errc() || parsed.ptr != cell.data() + cell.size() || !std::isfinite(row[c])) {
        return refuse(fmt::format("\"{}\" is not a number", cell));
      }
    }
    if (has_header) {
      known.push_back(
          {Vector3(row[0], row[1], row[2]) * kMillimetre, Vector3(row[3], row[4], row[5]) * kMicrometre});
    }
    has_header = true;
  }
  if (known.empty()) return daemon::fail(ErrorCode::BadInput, file.string() + ": has no row");
  return known;
}

Result<void> write_grid_csv(const std::filesystem::path& file, std::span<const v1::GridNode> nodes) {
  std::string text = "x_mm,y_mm,z_mm,ex_um,ey_um,ez_um,ux_um,uy_um,uz_um\n";
  for (const v1::GridNode& node : nodes) {
    const auto& p = node.position_m();
    const auto& e = node.error_m();
    const auto& cov = node.cov_m2();  // xx xy xz yy yz zz
    text += fmt::format("{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n",
                        p[0] / kMillimetre, p[1] / kMillimetre, p[2] / kMillimetre, e[0] / kMicrometre,
                        e[1] / kMicrometre, e[2] / kMicrometre, std::sqrt(cov[0]) / kMicrometre,
                        std::sqrt(cov[3]) / kMicrometre, std::sqrt(cov[5]) / kMicrometre);
  }
  std::ofstream out(file, std::ios::trunc);
  if (!(out << text).flush()) return daemon::fail(ErrorCode::Io, file.string() + ": cannot be written");
  return {};
}

Result<GridInterpolation> GridInterpolation::create(std::span<const v1::GridNode> nodes) {
  GridInterpolation grid;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    auto& values = grid.nodes_m_[axis];
    for (const v1::GridNode& node : nodes) values.push_back(node.position_m()[axis]);
    std::sort(values.begin(), values.end());
    values.erase(std::unique(values.begin(), values.end()), values.end());
  }
  const auto& [x, y, z] = grid.nodes_m_;
  if (nodes.empty() || x.size() * y.size() * z.size() != nodes.size()) {
    return daemon::fail(ErrorCode::BadInput, fmt::format("grid: {} nodes are not {} x {} x {} combinations",
                                                         nodes.size(), x.size(), y.size(), z.size()));
  }
  grid.error_m_.resize(nodes.size(), Vector3::Constant(std::nan("")));
  grid.inside_.resize(nodes.size());
  for (const v1::GridNode& node : nodes) {
    std::size_t index = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto& values = grid.nodes_m_[axis];
      const auto at = std::lower_bound(values.begin(), values.end(), node.position_m()[axis]);
      index = index * values.size() + static_cast<std::size_t>(at - values.begin());
    }
    grid.error_m_[index] = vector_of(node.error_m());
    grid.inside_[index] = node.inside();
  }
  if (std::any_of(grid.error_m_.begin(), grid.error_m_.end(),
                  [](const Vector3& e) { return !e.allFinite(); })) {
    return daemon::fail(ErrorCode::BadInput, "grid: a node is missing, doubled or not a number");
  }
  return grid;
}

bool GridInterpolation::at(const Vector3& position_m, Vector3& error_m) const {
  std::array<std::size_t, 3> cell{};
  std::array<double, 3> fraction{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!locate(nodes_m_[axis], position_m[static_cast<int>(axis)], cell[axis], fraction[axis])) return false;
  }
  Vector3 sum = Vector3::Zero();
  for (std::size_t corner = 0; corner < 8; ++corner) {
    double weight = 1.0;
    std::size_t index = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t far = (corner >> axis) & 1u;
      weight *= far == 1 ? fraction[axis] : 1.0 - fraction[axis];
      index = index * nodes_m_[axis].size() + cell[axis] + far;
    }
    if (!inside_[index]) return false;
    sum += weight * error_m_[index];
  }
  error_m = sum;
  return true;
}

Result<GridComparison> compare(std::span<const KnownError> known, const GridInterpolation& grid) {
  GridComparison comparison;
  std::vector<Vector3> points, before, after;
  for (const KnownError& k : known) {
    Vector3 received;
    if (!grid.at(k.position_m, received)) {
      ++comparison.outside;
      continue;
    }
    points.push_back(k.position_m);
    before.push_back(k.error_m);
    after.push_back(k.error_m - received);
  }
  comparison.points = points.size();
  const auto difference = calib::rigid_free(points, after);
  if (!difference) {
    return daemon::fail(ErrorCode::DataInsufficient, fmt::format("compare: {} points inside the grid: {}",
                                                                 points.size(), difference.error().text));
  }
  comparison.before = calib::vector_statistics(before);
  comparison.after = difference->as_stated;
  comparison.after_rigid_free = difference->rigid_free;
  return comparison;
}

}  // namespace abbe::dds
