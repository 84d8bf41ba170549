#include "run/robust_line.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::otf {

RobustLine::RobustLine(std::span<const double> x, std::span<const double> y) {
  const std::size_t parts = std::min(kParts, x.size());
  std::vector<double> part_x, part_y, values;
  const auto median_of_part = [&](std::span<const double> of, std::size_t part) {
    const std::size_t begin = part * of.size() / parts, end = (part + 1) * of.size() / parts;
    values.assign(of.begin() + static_cast<std::ptrdiff_t>(begin),
                  of.begin() + static_cast<std::ptrdiff_t>(end));
    return median(values);
  };
  for (std::size_t i = 0; i < parts; ++i) {
    part_x.push_back(median_of_part(x, i));
    part_y.push_back(median_of_part(y, i));
  }

  constexpr double kSamePlace = 1e-6;  // closer x are the same place: the target stands still, or a
                                       // point is wrong
  std::vector<double> slopes, to_others;
  for (std::size_t i = 0; i < parts; ++i) {
    to_others.clear();
    for (std::size_t j = 0; j < parts; ++j) {
      if (std::abs(part_x[j] - part_x[i]) > kSamePlace) {
        to_others.push_back((part_y[j] - part_y[i]) / (part_x[j] - part_x[i]));
      }
    }
    if (!to_others.empty()) {
      slopes.push_back(median(to_others));
    }
  }
  slope_ = median(slopes);

  values.clear();
  for (std::size_t i = 0; i < parts; ++i) {
    values.push_back(part_y[i] - slope_ * part_x[i]);
  }
  intercept_ = median(values);
}

}  // namespace abbe::calib::otf
