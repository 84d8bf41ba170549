#include "abbe/calib/otf/run/path_index.hpp"

#include <gtest/gtest.h>

#include <random>

namespace abbe::calib::otf {
namespace {

Path random_path(std::size_t vertices, double step_m, std::mt19937& random) {
  std::uniform_real_distribution<double> step(-step_m, step_m);
  Path path;
  Vector3 p = Vector3::Zero();
  for (std::size_t i = 0; i < vertices; ++i) {
    path.vertices_m.push_back(p);
    if (i % 7 != 3)
      p += Vector3(step(random), step(random), step(random));  // otherwise the leg would be a point
  }
  return path;
}

/// Checks every leg, one after the other.
std::optional<std::size_t> first_of_all(const Path& path, const Vector3& p, double within,
                                        std::size_t from) {
  for (std::size_t i = from; i + 1 < path.vertices_m.size(); ++i)
    if (nearest_on_leg(path.vertices_m[i], path.vertices_m[i + 1], p).off_m <= within) return i;
  return std::nullopt;
}

TEST(PathIndex, AnswersAsALookAtEveryLegDoes) {
  std::mt19937 random{14};
  std::uniform_real_distribution<double> at(-0.5, 0.5);
  for (const std::size_t vertices : {2u, 3u, 8u, 9u, 10u, 100u, 1000u}) {
    const PathIndex index{random_path(vertices, 0.1, random)};
    for (int i = 0; i < 300; ++i) {
      const Vector3 p(at(random), at(random), at(random));
      const double nearest = distance_to_path_m(index.path(), p);
      EXPECT_EQ(index.distance_m(p), nearest);
      const std::size_t from = random() % vertices;
      EXPECT_EQ(index.first_within(p, nearest), first_of_all(index.path(), p, nearest, 0))
          << "exactly there";
      EXPECT_EQ(index.first_within(p, 0.1, from), first_of_all(index.path(), p, 0.1, from));
    }
  }
}

TEST(PathIndex, OfNoLegIsFarFromEverything) {
  const PathIndex none{Path{}};
  EXPECT_EQ(none.distance_m(Vector3::Zero()), std::numeric_limits<double>::infinity());
  EXPECT_FALSE(none.first_within(Vector3::Zero(), 1.0));
  const PathIndex one{Path{{Vector3::Zero()}}};
  EXPECT_FALSE(one.first_within(Vector3::Zero(), 1.0));
}

}  // namespace
}  // namespace abbe::calib::otf
