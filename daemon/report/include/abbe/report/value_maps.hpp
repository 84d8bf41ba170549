#pragma once
/// Maps of a value over a plane, side by side, with one colour scale: from light (0) to dark
/// (largest value). The order of the values is therefore also visible to people with colour vision
/// deficiency and in a print without colours. Drawn as SVG. Pure.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace abbe::daemon {

struct ValueMap {
  std::string title;
  /// Edges of the cells, ascending, in the unit of the axes: n + 1 edges for n cells.
  std::vector<double> x_edges, y_edges;
  /// Values >= 0, one per cell, x fastest. NaN: no value, the cell is hatched.
  std::vector<double> values;
};

struct ValueMaps {
  std::string title, x_label, y_label;
  std::string scale_label;  ///< quantity and unit of the values
  std::vector<ValueMap> maps;
  /// a map is not wider than if this number of maps were side by side
  std::size_t least_places = 1;
};

/// An SVG element. Each cell with a value carries the value in the attribute data-v.
[[nodiscard]] std::string svg(const ValueMaps& maps);

}  // namespace abbe::daemon
