#include "abbe/calib/model/interpolation_grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "evemu_study.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::tests::evemu;

constexpr std::size_t kMost = 4096;

const VolumetricModel& table3_model() {
  static const VolumetricModel model =
      evemu::solve(simulated(reference_layout(), table3_machine(), {8e-6, 0.1e-3}, 1))->model;
  return model;
}

std::size_t nodes_of(const InterpolationGrid& grid) {
  return grid.axes_m[0].size() * grid.axes_m[1].size() * grid.axes_m[2].size();
}

enum class Values { OfTheModel, WithTheMeanError };

/// Errors of linear interpolation at three Gauss points per axis in every cell; their mean square
/// and the stated one.
struct Missed {
  double mean_m = 0.0, max_m = 0.0;
  double squares_m2 = 0.0, stated_m2 = 0.0;
};

Missed missed(const VolumetricModel& model, const InterpolationGrid& grid,
              Values values = Values::WithTheMeanError) {
  Missed m;
  std::size_t count = 0;
  const auto& [x, y, z] = grid.axes_m;
  const Vector3 t = model.tool_offsets_m().front();
  constexpr std::array kAt{0.113, 0.5,
                           0.887};  // three Gauss points: exact for the square of a parabola
  constexpr std::array kWeight{5.0 / 18, 8.0 / 18, 5.0 / 18};
  double weights = 0.0;

  for (std::size_t i = 0; i + 1 < x.size(); ++i) {
    for (std::size_t j = 0; j + 1 < y.size(); ++j) {
      for (std::size_t k = 0; k + 1 < z.size(); ++k) {
        std::array<Vector3, 8> V;
        double stated_m2 = 0.0;
        for (std::size_t c = 0; c < 8; ++c) {
          const std::array<std::size_t, 3> at{i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)};
          const InterpolationError error = interpolation_error(model, grid, at);
          V[c] = model.V_at({x[at[0]], y[at[1]], z[at[2]]}, t);
          if (values == Values::WithTheMeanError) {
            V[c] += error.mean_m;
          }
          stated_m2 += error.moment_m2.trace() / 8;
        }
        for (std::size_t n = 0; n < 27; ++n) {
          const std::array<std::size_t, 3> g{n % 3, n / 3 % 3, n / 9};
          const Vector3 s(kAt[g[0]], kAt[g[1]], kAt[g[2]]);
          const double weight = kWeight[g[0]] * kWeight[g[1]] * kWeight[g[2]];
          Vector3 between = Vector3::Zero();
          for (std::size_t c = 0; c < 8; ++c) {
            between += ((c & 1) != 0 ? s.x() : 1 - s.x()) *
                       ((c >> 1 & 1) != 0 ? s.y() : 1 - s.y()) * (c >> 2 != 0 ? s.z() : 1 - s.z()) *
                       V[c];
          }
          const Vector3 q(x[i] + s.x() * (x[i + 1] - x[i]), y[j] + s.y() * (y[j + 1] - y[j]),
                          z[k] + s.z() * (z[k + 1] - z[k]));
          const double off_m = (model.V_at(q, t) - between).norm();
          m.max_m = std::max(m.max_m, off_m);
          m.mean_m += weight * off_m;
          m.squares_m2 += weight * off_m * off_m;
          weights += weight;
        }
        m.stated_m2 += stated_m2;
        ++count;
      }
    }
  }

  m.mean_m /= weights;
  m.squares_m2 /= weights;
  m.stated_m2 /= static_cast<double>(count);

  return m;
}

TEST(InterpolationGrid, IsAsFineAsItMayBe) {
  const InterpolationGrid grid = interpolation_grid(table3_model(), kMost);
  EXPECT_LE(nodes_of(grid), kMost);
  EXPECT_GT(nodes_of(grid), kMost * 8 / 10);
  EXPECT_FALSE(grid.every_node);
  for (const auto& axis : grid.axes_m) {
    EXPECT_TRUE(std::is_sorted(axis.begin(), axis.end()));
  }
}

TEST(InterpolationGrid, MissesLittleOfAMachineOfMillimetres) {
  const Missed m = missed(table3_model(), interpolation_grid(table3_model(), kMost));
  RecordProperty("mean_um", std::to_string(1e6 * m.mean_m));
  RecordProperty("max_um", std::to_string(1e6 * m.max_m));
  EXPECT_LT(m.mean_m, 5e-6);  // machine errors 3.3 mm
  EXPECT_LT(m.max_m, 20e-6);
}

TEST(InterpolationGrid, MissesLessWithTheMeanErrorThanWithTheModelAtTheNodes) {
  const auto grid = interpolation_grid(table3_model(), kMost);
  const Missed with = missed(table3_model(), grid),
               of_model = missed(table3_model(), grid, Values::OfTheModel);
  // sqrt((8/15) / (4/45)) = 2.4 for one axis
  EXPECT_LT(with.squares_m2, of_model.squares_m2 / (2.0 * 2.0));
}

TEST(InterpolationGrid, StatesWhatItMisses) {
  for (const std::size_t most : {std::size_t{125}, std::size_t{729}, kMost}) {
    const Missed m = missed(table3_model(), interpolation_grid(table3_model(), most));
    // The larger error of two neighbouring cells is stated: slightly more than the actual one.
    EXPECT_GT(m.stated_m2, 0.9 * m.squares_m2) << most;
    EXPECT_LT(m.stated_m2, 2.0 * m.squares_m2) << most;
  }
}

}  // namespace
