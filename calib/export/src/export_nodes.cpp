#include <algorithm>
#include <cmath>
#include <random>

#include "abbe/calib/export/held_correction.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "motion_fit.hpp"

namespace abbe::calib {
namespace {

constexpr double kDefaultSteps = 32.0;  ///< number of steps of an axis for cubic tables and
                                        ///< polynomials

std::vector<double> equal_steps(double first, double last, double largest_step) {
  const double steps = std::max(1.0, std::ceil((last - first) / largest_step - 1e-9));
  std::vector<double> nodes;
  for (double i = 0.0; i <= steps; ++i) nodes.push_back(first + (last - first) * i / steps);
  nodes.back() = last;
  return nodes;
}

/// The nodes of linear tables that lie inside the box, and both ends of the box.
std::vector<double> table_nodes(std::span<const double> of_tables, double first, double last) {
  constexpr double kSame_m = 1e-9;
  std::vector<double> nodes{first};
  for (const double q : of_tables) {
    if (q > first + kSame_m && q < last - kSame_m) nodes.push_back(q);
  }
  nodes.push_back(last);
  return nodes;
}

double smallest_step(std::span<const double> nodes) {
  double step = nodes[1] - nodes[0];
  for (std::size_t i = 1; i < nodes.size(); ++i) step = std::min(step, nodes[i] - nodes[i - 1]);
  return step;
}

std::vector<double> nodes_of_axis(const VolumetricModel& model, std::size_t a, double first,
                                  double last, const NodeOptions& options) {
  if (options.step_m) return equal_steps(first, last, *options.step_m);
  if (!model.linear_between_nodes()) {
    return equal_steps(first, last, (last - first) / kDefaultSteps);
  }
  auto nodes = table_nodes(model.nodes()[a].nodes_m, first, last);
  if (options.equidistant) {
    const double smallest = std::max(smallest_step(nodes), (last - first) / kMostFittedNodes);
    nodes = equal_steps(first, last, smallest);
  }
  return nodes;
}

}  // namespace

Result<ExportBox> export_box(const VolumetricModel& model, const std::optional<ExportBox>& part) {
  const auto vertices = model.validity().vertices_m();
  if (vertices.empty()) {
    return failure(ErrorCode::TooFewObservations, "export: the model has no validity volume");
  }
  ExportBox box{vertices.front(), vertices.front()};
  for (const Vector3& vertex : vertices) {
    box.min_m = box.min_m.cwiseMin(vertex);
    box.max_m = box.max_m.cwiseMax(vertex);
  }
  if (!part) return box;

  constexpr double kTolerance_m = ValidityVolume::kTolerance_m;
  for (const Axis axis : kAllAxes) {
    const auto a = static_cast<Eigen::Index>(index(axis));
    const bool within = part->min_m[a] >= box.min_m[a] - kTolerance_m &&
                        part->max_m[a] <= box.max_m[a] + kTolerance_m;
    if (!within || !(part->min_m[a] < part->max_m[a])) {
      return failure(ErrorCode::BadInput,
                     message("volume of the export: ", letter(axis), " ", 1e3 * part->min_m[a],
                             " to ", 1e3 * part->max_m[a], " mm; the model is valid from ",
                             1e3 * box.min_m[a], " to ", 1e3 * box.max_m[a], " mm"));
    }
  }
  return *part;
}

Result<GridAxes> export_nodes(const VolumetricModel& model, const ExportBox& box,
                              const NodeOptions& options) {
  GridAxes axes;
  for (const Axis axis : kAllAxes) {
    const auto a = static_cast<Eigen::Index>(index(axis));
    const double length = box.max_m[a] - box.min_m[a];
    if (options.step_m &&
        !(*options.step_m > 0.0 && length / *options.step_m < kMostExportNodes - 1)) {
      return failure(ErrorCode::BadInput, message("nodes of ", letter(axis), ": a step of ",
                                                  1e3 * *options.step_m, " mm over ", 1e3 * length,
                                                  " mm; it must be positive and give at most ",
                                                  kMostExportNodes, " nodes"));
    }
    axes[index(axis)] = nodes_of_axis(model, index(axis), box.min_m[a], box.max_m[a], options);
  }
  return axes;
}

Result<std::vector<ExportPlace>> random_places(const VolumetricModel& model, const ExportBox& box,
                                               std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<ExportPlace> places;

  for (std::size_t tries = 0; places.size() < count && tries < 1000 * count; ++tries) {
    ExportPlace place;
    for (Eigen::Index a = 0; a < 3; ++a) {
      place.commanded_m[a] = box.min_m[a] + unit() * (box.max_m[a] - box.min_m[a]);
      const bool forward = unit() < 0.5;
      place.travel[static_cast<std::size_t>(a)] = forward ? Travel::Forward : Travel::Backward;
    }
    if (model.validity().contains(place.commanded_m)) places.push_back(place);
  }
  if (places.size() < count) {
    return failure(ErrorCode::DegenerateGeometry,
                   "export: less than 1/1000 of the volume is inside the validity volume");
  }
  return places;
}

}  // namespace abbe::calib
