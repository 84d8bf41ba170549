#include <array>

#include "abbe/sim/path_motion.hpp"
#include "csv.hpp"
#include "units.hpp"

namespace abbe::sim {
namespace {

constexpr double kMetresPerSecondPerFeed = 1e-3 / 60.0;  // mm/min
constexpr std::array<std::string_view, 4> kPathColumns{"x_mm", "y_mm", "z_mm", "feed_mm_per_min"};

bool header_is_right(const CsvTable& table) {
  const std::size_t n = table.header.size();
  return (n == 3 || n == 4) &&
         std::equal(table.header.begin(), table.header.end(), kPathColumns.begin());
}

void read_feed(const CsvTable& table, const CsvRow& row, PathVertex& vertex, CsvErrors& errors) {
  if (row.cells.size() < 4 || row.cells[3].empty()) return;
  const auto feed = csv_number(table, row, 3, errors);
  if (!feed) return;
  if (*feed <= 0.0) errors.add(row.line, "column feed_mm_per_min: must be positive");
  vertex.feed_m_per_s = *feed * kMetresPerSecondPerFeed;
}

}  // namespace

Result<std::vector<PathVertex>> parse_path_csv(std::string_view text, std::string_view name) {
  CsvErrors errors(name);
  const CsvTable table = split_csv(text, errors);
  if (!table.header.empty() && !header_is_right(table)) {
    errors.add(1, "the header must be x_mm,y_mm,z_mm[,feed_mm_per_min]");
    return tl::unexpected(errors.error());
  }

  std::vector<PathVertex> vertices;
  for (const CsvRow& row : table.rows) {
    PathVertex vertex;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto value = csv_number(table, row, k, errors);
      if (value) vertex.q_m[static_cast<Eigen::Index>(k)] = *value * kMPerMm;
    }
    read_feed(table, row, vertex, errors);
    vertices.push_back(vertex);
  }

  if (vertices.empty()) errors.add(1, "no points");
  if (errors.any()) return tl::unexpected(errors.error());
  return vertices;
}

}  // namespace abbe::sim
