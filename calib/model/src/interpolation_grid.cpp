#include "abbe/calib/model/interpolation_grid.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::calib {
namespace {

/// Selects `count` >= 2 nodes evenly by index, including both ends.
std::vector<double> decimated(const std::vector<double>& nodes_m, std::size_t count) {
  std::vector<double> out;
  for (std::size_t i = 0; i < count; ++i) {
    out.push_back(nodes_m[i * (nodes_m.size() - 1) / (count - 1)]);
  }
  return out;
}

InterpolationGrid of_tables(const MachineNodes& nodes, std::size_t most_nodes) {
  std::array<std::size_t, 3> count{};
  for (std::size_t a = 0; a < 3; ++a) {
    count[a] = nodes[a].nodes_m.size();
  }

  InterpolationGrid grid{{}, true};
  while (count[0] * count[1] * count[2] > most_nodes) {
    --*std::max_element(count.begin(), count.end());
    grid.every_node = false;
  }

  for (std::size_t a = 0; a < 3; ++a) {
    grid.axes_m[a] = decimated(nodes[a].nodes_m, count[a]);
  }

  return grid;
}

/// For each axis, an estimate from second differences on a lattice of the largest interpolation
/// error of V at the midpoint of a cell that extends over the whole box.
std::array<double, 3> midpoint_error_m(const VolumetricModel& model, const ReadingBox& box) {
  constexpr std::array kAt{-0.8, -0.4, 0.0, 0.4, 0.8};
  constexpr double kStep = 0.2;  // fraction of the half width; 0.8 + 0.2 is inside the box
  const Vector3& t = model.tool_offsets_m().front();
  std::array<double, 3> most{};

  for (const double x : kAt) {
    for (const double y : kAt) {
      for (const double z : kAt) {
        const Vector3 q = box.centre_m + Vector3(x, y, z).cwiseProduct(box.half_width_m);
        const Vector3 V = model.V_at(q, t);
        for (int a = 0; a < 3; ++a) {
          const Vector3 step = kStep * box.half_width_m(a) * Vector3::Unit(a);
          const Vector3 second = model.V_at(q + step, t) - 2 * V + model.V_at(q - step, t);
          auto& of_axis = most[static_cast<std::size_t>(a)];
          of_axis = std::max(of_axis, second.norm() / (2 * kStep * kStep));
        }
      }
    }
  }

  return most;
}

/// Adds one node at a time to the axis with the largest interpolation error, up to `most_nodes` in
/// total. The interpolation error is proportional to 1 / cells^2.
std::array<std::size_t, 3> counts_for(const std::array<double, 3>& midpoint_error_m,
                                      std::size_t most_nodes) {
  std::array<std::size_t, 3> count{2, 2, 2};
  std::array<bool, 3> full{};
  while (!(full[0] && full[1] && full[2])) {
    std::size_t worst = 3;
    double most = -1.0;
    for (std::size_t a = 0; a < 3; ++a) {
      const double cells = static_cast<double>(count[a] - 1);
      if (const double miss = midpoint_error_m[a] / (cells * cells); !full[a] && miss > most) {
        most = miss;
        worst = a;
      }
    }
    ++count[worst];
    if (count[0] * count[1] * count[2] > most_nodes) {
      --count[worst];
      full[worst] = true;
    }
  }

  return count;
}

/// For each axis, the largest error of linear interpolation at the midpoint of a cell over the
/// whole range, |d^2V/dq^2| length^2 / 8. Along an axis the second derivative is linear between the
/// nodes of its tables, across it linear in the other axes: it is largest at a node and at ends of
/// the other axes.
std::array<double, 3> midpoint_error_of_cubic_m(const VolumetricModel& model) {
  const MachineNodes& nodes = model.tables()->layout().nodes();
  const Vector3& t = model.tool_offsets_m().front();
  std::array<double, 3> most{};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto k = static_cast<Eigen::Index>(a);
    const std::vector<double>& along = nodes[a].nodes_m;
    const double length_m = along.back() - along.front();
    MachineNodes places;
    for (std::size_t b = 0; b < 3; ++b) {
      places[b].nodes_m = {nodes[b].nodes_m.front(), nodes[b].nodes_m.back()};
    }
    places[a].nodes_m = along;

    const double step_m = 1e-2 * length_m / static_cast<double>(along.size() - 1);
    const Vector3 step = step_m * Vector3::Unit(k);
    for (const Vector3& q : tensor_grid(places)) {
      const Vector3 second =
          model.V_at(q + step, t) - 2 * model.V_at(q, t) + model.V_at(q - step, t);
      most[a] = std::max(most[a], second.norm() / (step_m * step_m) * length_m * length_m / 8.0);
    }
  }
  return most;
}

/// A grid with equidistant nodes over a box.
InterpolationGrid equidistant(const ReadingBox& box, const std::array<std::size_t, 3>& count) {
  InterpolationGrid grid;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto k = static_cast<Eigen::Index>(a);
    const double cells = static_cast<double>(count[a] - 1);
    for (std::size_t i = 0; i < count[a]; ++i) {
      const double u = 2.0 * static_cast<double>(i) / cells - 1.0;
      grid.axes_m[a].push_back(box.centre_m(k) + u * box.half_width_m(k));
    }
  }
  return grid;
}

InterpolationGrid of_polynomials(const VolumetricModel& model, std::size_t most_nodes) {
  const ReadingBox box = bounding_box(model.validity().vertices_m());
  return equidistant(box, counts_for(midpoint_error_m(model, box), most_nodes));
}

InterpolationGrid of_cubic_tables(const VolumetricModel& model, std::size_t most_nodes) {
  const MachineNodes& nodes = model.nodes();
  const std::array ends{
      Vector3(nodes[0].nodes_m.front(), nodes[1].nodes_m.front(), nodes[2].nodes_m.front()),
      Vector3(nodes[0].nodes_m.back(), nodes[1].nodes_m.back(), nodes[2].nodes_m.back())};
  return equidistant(bounding_box(ends), counts_for(midpoint_error_of_cubic_m(model), most_nodes));
}

/// Interpolation error halfway between `q` and its neighbour node at `beside_m` along axis `a`.
Vector3 miss_halfway(const VolumetricModel& model, const Vector3& q, Eigen::Index a,
                     double beside_m) {
  const Vector3& t = model.tool_offsets_m().front();
  Vector3 beside = q;
  beside(a) = beside_m;
  return model.V_at(0.5 * (q + beside), t) - 0.5 * (model.V_at(q, t) + model.V_at(beside, t));
}

/// Interpolation errors halfway to the two neighbour nodes along an axis. A node at an end of the
/// axis has one neighbour; both values are then the error halfway to it.
struct Misses {
  Vector3 before, after;
};

std::array<Misses, 3> misses_halfway(const VolumetricModel& model, const InterpolationGrid& grid,
                                     const std::array<std::size_t, 3>& node) {
  const GridAxes& axes = grid.axes_m;
  const Vector3 q(axes[0][node[0]], axes[1][node[1]], axes[2][node[2]]);
  std::array<Misses, 3> all;

  for (std::size_t a = 0; a < 3; ++a) {
    const auto k = static_cast<Eigen::Index>(a);
    const std::size_t i = node[a], last = axes[a].size() - 1;
    all[a].before = miss_halfway(model, q, k, axes[a][i > 0 ? i - 1 : i + 1]);
    all[a].after = i == 0 || i == last ? all[a].before : miss_halfway(model, q, k, axes[a][i + 1]);
  }
  return all;
}

}  // namespace

InterpolationGrid interpolation_grid(const VolumetricModel& model, std::size_t most_nodes) {
  if (model.linear_between_nodes()) {
    return of_tables(model.nodes(), most_nodes);
  }
  return model.tables() != nullptr ? of_cubic_tables(model, most_nodes)
                                   : of_polynomials(model, most_nodes);
}

InterpolationError interpolation_error(const VolumetricModel& model, const InterpolationGrid& grid,
                                       const std::array<std::size_t, 3>& node) {
  if (grid.every_node) {
    return {};
  }

  constexpr double kMean = 2.0 / 3.0, kSquare = 8.0 / 15.0;
  const bool curved = !model.linear_between_nodes();
  InterpolationError out;
  Vector3 larger_of_all = Vector3::Zero();

  for (const Misses& miss : misses_halfway(model, grid, node)) {
    const Vector3 larger = miss.before.norm() > miss.after.norm() ? miss.before : miss.after;
    out.moment_m2 += (kSquare - kMean * kMean) * larger * larger.transpose();
    larger_of_all += larger;
    if (curved) {
      const Vector3 half = 0.5 * (miss.after - miss.before);
      out.mean_m += kMean * 0.5 * (miss.before + miss.after);
      out.moment_m2 += kMean * kMean * half * half.transpose();
    }
  }

  if (!curved) {
    out.moment_m2 += kMean * kMean * larger_of_all * larger_of_all.transpose();
  }
  return out;
}

}  // namespace abbe::calib
