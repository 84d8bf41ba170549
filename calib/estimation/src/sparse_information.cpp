#include "abbe/calib/internal/estimation/sparse_information.hpp"

#include <map>

namespace abbe::calib::estimation {
namespace {

using RowGroup = std::vector<const WeightedRow*>;

/// Unknowns that occur in the rows, ascending.
std::vector<std::size_t> unknowns_in(const RowGroup& group, std::size_t unknowns) {
  std::vector<bool> occurs(unknowns, false);
  for (const WeightedRow* row : group) {
    for (const RowEntry& e : row->entries) {
      occurs[e.column] = true;
    }
  }

  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < unknowns; ++i) {
    if (occurs[i]) {
      found.push_back(i);
    }
  }

  return found;
}

/// Information of the rows about the given unknowns only.
Information information_of_group(const RowGroup& group, const std::vector<std::size_t>& found,
                                 std::size_t unknowns) {
  std::vector<std::size_t> place(unknowns, 0);
  for (std::size_t i = 0; i < found.size(); ++i) {
    place[found[i]] = i;
  }

  Information part(found.size());
  RowBatch batch(found.size());
  std::vector<RowEntry> entries;
  for (const WeightedRow* row : group) {
    entries.clear();
    for (const RowEntry& e : row->entries) {
      entries.push_back({place[e.column], e.value});
    }
    batch.append(entries, row->y, row->root_weight);
    if (batch.full()) {
      part.add(batch);
    }
  }
  part.add(batch);

  return part;
}

}  // namespace

Information information_of(std::size_t unknowns, std::span<const WeightedRow> rows) {
  std::map<std::size_t, RowGroup> groups;
  for (const WeightedRow& row : rows) {
    groups[row.entries.empty() ? 0 : row.entries.front().column].push_back(&row);
  }

  Information sum(unknowns);
  for (const auto& [first, group] : groups) {
    const std::vector<std::size_t> found = unknowns_in(group, unknowns);
    sum.add(information_of_group(group, found, unknowns), found);
  }

  return sum;
}

}  // namespace abbe::calib::estimation
