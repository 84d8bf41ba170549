#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "abbe/base/units.hpp"
#include "abbe/report/model_figures.hpp"
#include "abbe/report/sections.hpp"

namespace abbe::daemon {
namespace {

using calib::Axis;
using calib::Vector3;

constexpr std::size_t kMostCells = 20, kMostCellsOfLeftErrors = 8, kFewestCells = 4;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// `count` + 1 equidistant edges.
std::vector<double> edges(double first, double last, std::size_t count) {
  std::vector<double> all;
  for (std::size_t i = 0; i <= count; ++i)
    all.push_back(first + (last - first) * static_cast<double>(i) / static_cast<double>(count));
  return all;
}

std::vector<double> in_mm(const std::vector<double>& lengths_m) {
  std::vector<double> out;
  for (const double m : lengths_m) out.push_back(m * kMmPerM);
  return out;
}

/// Index of the interval between two edges that contains the value. For a value outside all
/// intervals, the index of the nearest one.
template <class Edges>
std::size_t interval_of(const Edges& edges, double value) {
  const auto above = std::upper_bound(edges.begin() + 1, edges.end() - 1, value);
  return static_cast<std::size_t>(above - edges.begin()) - 1;
}

double component(const Vector3& q, Axis axis) {
  return q(static_cast<Eigen::Index>(index(axis)));
}

/// Three maps without values.
ValueMaps empty_maps(const VolumeCuts& cuts, std::string title, std::string scale_label) {
  ValueMaps maps{.title = std::move(title),
                 .x_label = fmt::format("{}, mm", letter(cuts.x)),
                 .y_label = fmt::format("{}, mm", letter(cuts.y)),
                 .scale_label = std::move(scale_label),
                 .maps = {}};
  const std::size_t cells = (cuts.x_edges_m.size() - 1) * (cuts.y_edges_m.size() - 1);
  for (std::size_t k = 0; k < 3; ++k)
    maps.maps.push_back(
        {.title = fmt::format("{} = {:.0f} mm", letter(cuts.across), cuts.cut_m(k) * kMmPerM),
         .x_edges = in_mm(cuts.x_edges_m),
         .y_edges = in_mm(cuts.y_edges_m),
         .values = std::vector<double>(cells, kNone)});
  return maps;
}

/// Mean and largest value of all cells: "mean 41.2 um, largest 96.1 um".
std::string summary(const ValueMaps& maps) {
  double sum = 0.0, largest = 0.0;
  std::size_t count = 0;
  for (const ValueMap& map : maps.maps) {
    for (const double v : map.values) {
      if (std::isnan(v)) continue;
      sum += v;
      largest = std::max(largest, v);
      ++count;
    }
  }

  if (count == 0) return "no cell of the maps is inside the validity volume";
  return fmt::format("mean {:.2f} um, largest {:.2f} um", sum / static_cast<double>(count),
                     largest);
}

struct ModelMaps {
  ValueMaps V, U, misfit;  ///< `misfit`: the part of U(V) that the misfit causes; it is not drawn
};

/// The values of |V| and U(V) at the middles of the cells.
ModelMaps maps_of(const calib::VolumetricModel& model) {
  const VolumeCuts cuts = volume_cuts(model.validity(), kMostCells);
  ModelMaps maps{empty_maps(cuts, "Before: error |V| of the machine without compensation", "um"),
                 empty_maps(cuts, "After: expanded uncertainty U(V), k = 2", "um"),
                 empty_maps(cuts, "", "um")};
  const std::size_t columns = cuts.x_edges_m.size() - 1, rows = cuts.y_edges_m.size() - 1;
  Vector3 q = Vector3::Zero();

  for (std::size_t slab = 0; slab < 3; ++slab) {
    q(static_cast<Eigen::Index>(index(cuts.across))) = cuts.cut_m(slab);
    for (std::size_t i = 0; i < columns * rows; ++i) {
      const std::size_t c = i % columns, r = i / columns;
      q(static_cast<Eigen::Index>(index(cuts.x))) =
          0.5 * (cuts.x_edges_m[c] + cuts.x_edges_m[c + 1]);
      q(static_cast<Eigen::Index>(index(cuts.y))) =
          0.5 * (cuts.y_edges_m[r] + cuts.y_edges_m[r + 1]);
      const auto e = model.error_at(q, model.tool_offsets_m().front(), calib::AxisTravel{});
      if (!e.inside) continue;
      maps.V.maps[slab].values[i] = e.V_m.norm() * kUmPerM;
      maps.U.maps[slab].values[i] = 2.0 * std::sqrt(e.cov_V_m2.trace()) * kUmPerM;
      maps.misfit.maps[slab].values[i] =
          2.0 * kUmPerM *
          std::sqrt(model.misfit_cov_V_m2(q, model.tool_offsets_m().front()).trace());
    }
  }

  return maps;
}

using Cells = std::span<const RunFigures::HeldOutCell>;

std::size_t observations_of(Cells cells) {
  std::size_t count = 0;
  for (const RunFigures::HeldOutCell& cell : cells) count += cell.count;
  return count;
}

/// The rms over all observations in the cells.
double rms(Cells cells, double RunFigures::HeldOutCell::*member) {
  double squares = 0.0;
  for (const RunFigures::HeldOutCell& cell : cells)
    squares += static_cast<double>(cell.count) * cell.*member * cell.*member;
  return std::sqrt(squares / static_cast<double>(observations_of(cells)));
}

/// A map of HeldOutCell::after_m in every cell of a slab. A cell that the map does not have is left
/// out; it occurs only if the file was changed.
ValueMaps map_of(Cells cells, const calib::ValidityVolume& volume) {
  const VolumeCuts cuts = volume_cuts(volume, kMostCellsOfLeftErrors);
  ValueMaps maps = empty_maps(
      cuts, "After: residual of observations to which the model was not fitted, rms", "um");
  for (std::size_t k = 0; k < 3; ++k)
    maps.maps[k].title =
        fmt::format("{} from {:.0f} to {:.0f} mm", letter(cuts.across),
                    cuts.slab_edges_m[k] * kMmPerM, cuts.slab_edges_m[k + 1] * kMmPerM);
  for (const RunFigures::HeldOutCell& cell : cells)
    if (cell.slab < maps.maps.size() && cell.cell < maps.maps[cell.slab].values.size())
      maps.maps[cell.slab].values[cell.cell] = kUmPerM * cell.after_m;
  return maps;
}

void add_held_out_cells(HtmlReport& page, const calib::ValidityVolume& volume, Cells cells) {
  page.maps(map_of(cells, volume));
  page.facts(
      {{"before, rms of one component", um_text(rms(cells, &RunFigures::HeldOutCell::before_m), 3)},
       {"after", um_text(rms(cells, &RunFigures::HeldOutCell::after_m), 3)},
       {"standard uncertainty of these observations",
        um_text(rms(cells, &RunFigures::HeldOutCell::sigma_m), 3)}});
  page.paragraph(fmt::format(
      "{} observations, each predicted by a model that was fitted without it. The observations of "
      "a run that are held out together are shown without a rigid motion, which is fitted to these "
      "same observations, before as well as after: errors that look like such a motion are not "
      "contained. The noise of the measurement is contained: with a perfect model the rms would be "
      "about the standard uncertainty of the observations.",
      observations_of(cells)));
}

}  // namespace

VolumeCuts volume_cuts(const calib::ValidityVolume& volume, std::size_t most) {
  Vector3 low = volume.vertices_m().front(), high = low;
  for (const Vector3& q : volume.vertices_m()) {
    low = low.cwiseMin(q);
    high = high.cwiseMax(q);
  }
  const Vector3 size = high - low;

  VolumeCuts cuts;
  for (const Axis axis : {Axis::Y, Axis::X})  // of sides with equal length, Z is chosen
    if (component(size, axis) < component(size, cuts.across)) cuts.across = axis;
  cuts.x = cuts.across == Axis::X ? Axis::Y : Axis::X;
  cuts.y = cuts.across == Axis::Z ? Axis::Y : Axis::Z;
  for (std::size_t i = 0; i < cuts.slab_edges_m.size(); ++i)
    cuts.slab_edges_m[i] =
        component(low, cuts.across) + component(size, cuts.across) * static_cast<double>(i) / 3.0;

  const double longer = std::max(component(size, cuts.x), component(size, cuts.y));
  const auto edges_of = [&](Axis axis) {
    const double cells = std::round(static_cast<double>(most) * component(size, axis) / longer);
    return edges(component(low, axis), component(high, axis),
                 std::max(kFewestCells, static_cast<std::size_t>(cells)));
  };
  cuts.x_edges_m = edges_of(cuts.x);
  cuts.y_edges_m = edges_of(cuts.y);

  return cuts;
}

std::vector<RunFigures::HeldOutCell> held_out_cells(const calib::ValidityVolume& volume,
                                                    std::span<const LeftError> left) {
  if (volume.vertices_m().empty()) return {};
  const VolumeCuts cuts = volume_cuts(volume, kMostCellsOfLeftErrors);
  const std::size_t columns = cuts.x_edges_m.size() - 1;
  const std::size_t of_slab = columns * (cuts.y_edges_m.size() - 1);
  std::vector<RunFigures::HeldOutCell> all(3 * of_slab);

  for (const LeftError& one : left) {  // the members first contain sums of squares
    const std::size_t slab =
        interval_of(cuts.slab_edges_m, component(one.axis_position_m, cuts.across));
    const std::size_t cell =
        interval_of(cuts.x_edges_m, component(one.axis_position_m, cuts.x)) +
        columns * interval_of(cuts.y_edges_m, component(one.axis_position_m, cuts.y));
    RunFigures::HeldOutCell& sum = all[slab * of_slab + cell];
    ++sum.count;
    sum.before_m += one.before_m * one.before_m;
    sum.after_m += one.after_m * one.after_m;
    sum.sigma_m += one.sigma_m * one.sigma_m;
  }

  std::vector<RunFigures::HeldOutCell> cells;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].count == 0) continue;
    const auto n = static_cast<double>(all[i].count);
    cells.push_back({.slab = i / of_slab,
                     .cell = i % of_slab,
                     .count = all[i].count,
                     .before_m = std::sqrt(all[i].before_m / n),
                     .after_m = std::sqrt(all[i].after_m / n),
                     .sigma_m = std::sqrt(all[i].sigma_m / n)});
  }
  return cells;
}

void add_before_and_after(HtmlReport& page, const calib::VolumetricModel& model, Cells held_out) {
  if (model.validity().vertices_m().empty()) return;
  constexpr std::size_t kMiddle = 1;
  ModelMaps maps = maps_of(model);
  const std::string cut = maps.V.maps[kMiddle].title;
  ValueMaps picture = std::move(maps.V);
  picture.title = fmt::format("Error before and after compensation, {}", cut);
  // The maps of a high volume are drawn narrower, so that the picture leaves space for the rest of
  // the page.
  const auto extent = [](const std::vector<double>& edges) { return edges.back() - edges.front(); };
  const ValueMap& first = picture.maps[kMiddle];
  picture.least_places = extent(first.y_edges) > extent(first.x_edges) ? 4 : 3;
  ValueMap before = std::move(picture.maps[kMiddle]), after = std::move(maps.U.maps[kMiddle]);
  before.title = "before: |V|";
  after.title = "after: |V| is below U(V)";
  picture.maps = {std::move(before), std::move(after)};
  if (observations_of(held_out) > 0) {
    ValueMap left = std::move(map_of(held_out, model.validity()).maps[kMiddle]);
    left.title = "after: residual, rms";
    picture.maps.push_back(std::move(left));
  }
  page.maps(picture);
}

void add_volume_maps(HtmlReport& page, const calib::VolumetricModel& model,
                     std::span<const RunFigures::HeldOutCell> held_out) {
  if (model.validity().vertices_m().empty()) return;
  page.heading("Volume before and after");
  const Vector3 tool_mm = model.tool_offsets_m().front() * kMmPerM;
  page.paragraph(fmt::format(
      "Three cuts through the volume in which the model is valid, for the tool offset {:.1f}, "
      "{:.1f}, {:.1f} mm. V: actual minus nominal position, in the datum of the model, without a "
      "rigid motion of the whole volume. Cells outside the volume or without data are hatched. "
      "Each row has its own scale.",
      tool_mm.x(), tool_mm.y(), tool_mm.z()));

  const ModelMaps maps = maps_of(model);
  page.maps(maps.V);
  page.maps(maps.U);
  page.facts(
      {{"before, |V|", summary(maps.V)},
       {"after, U(V): |V| left is below it with 95 to 99 %", summary(maps.U)},
       {"of U(V) due to misfit: errors that repeat at a place and that the form of the model "
        "cannot represent",
        model.misfit() != nullptr ? summary(maps.misfit) : "none found"}});
  page.paragraph(
      "U(V): twice the root of the sum of the variances of the three components (coverage factor k "
      "= 2), in the datum of the model. |V| that is left after compensation is below U(V) with 95 "
      "to "
      "99 %, apart from what U(V) does not contain: lack of fit that the residuals do not show, "
      "and "
      "changes of the machine after the measurement, for example with temperature.");
  if (observations_of(held_out) > 0) add_held_out_cells(page, model.validity(), held_out);
}

}  // namespace abbe::daemon
