#include <cmath>

#include "abbe/protocol/table/number_table.hpp"
#include "abbe/sim/path_motion.hpp"
#include "table_error.hpp"
#include "units.hpp"

namespace abbe::sim {
namespace {

constexpr double kMetresPerSecondPerFeed = 1e-3 / 60.0;  // mm/min
constexpr std::size_t kFeed = 3;                         // column

/// Feed of the leg that ends at this row; 0 (the feed of the plan applies) if the file has no
/// column of feeds or the cell of this row is empty.
double feed_m_per_s(const protocol::NumberTable& table, std::size_t row, protocol::Faults& faults) {
  if (!table.has(kFeed) || std::isnan(table.at(row, kFeed))) return 0.0;
  if (table.at(row, kFeed) <= 0.0)
    faults.add(table.line(row), 1, "feed_mm_per_min", "must be positive");
  return table.at(row, kFeed) * kMetresPerSecondPerFeed;
}

}  // namespace

Result<std::vector<PathVertex>> parse_path_csv(std::string_view text, std::string_view name) {
  protocol::Faults faults{std::string(name)};
  const auto table = protocol::parse_numbers(
      text,
      {{{"x_mm"},
        {"y_mm"},
        {"z_mm"},
        {.name = "feed_mm_per_min", .required = false, .may_be_empty = true}}},
      faults);
  if (!table) return tl::unexpected(table_error(faults));

  std::vector<PathVertex> vertices;
  for (std::size_t row = 0; row < table->rows(); ++row) {
    if (!table->sound(row)) continue;
    PathVertex vertex;
    for (std::size_t k = 0; k < 3; ++k)
      vertex.q_m[static_cast<Eigen::Index>(k)] = table->at(row, k) * kMPerMm;
    vertex.feed_m_per_s = feed_m_per_s(*table, row, faults);
    vertices.push_back(vertex);
  }

  if (table->rows() == 0) faults.add(1, 1, "", "no points");
  if (faults.any()) return tl::unexpected(table_error(faults));
  return vertices;
}

}  // namespace abbe::sim
