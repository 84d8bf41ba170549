#pragma once
/// Figures of a model that the reports of several methods use. All numbers are those of the model;
/// none is smoothed.

#include <array>
#include <span>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/model/run_figures.hpp"
#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

/// The residual of one observation to which the model was not fitted. The rigid motion that fits
/// best to all observations held out together with it is subtracted (calib/otf/judge/judge.hpp).
struct LeftError {
  calib::Vector3 axis_position_m = calib::Vector3::Zero();
  double before_m = 0.0;  ///< error without compensation
  double after_m = 0.0;   ///< error with the model
  double sigma_m = 0.0;   ///< standard uncertainty of the observation
};

/// Charts of all tables along their axes, as the model interpolates them, with bands of 2 u. Empty
/// for a model of polynomials.
[[nodiscard]] std::vector<LineChart> table_line_charts(const calib::VolumetricModel& model);

/// Three cuts through the validity volume, across the axis of its shortest side.
struct VolumeCuts {
  calib::Axis across = calib::Axis::Z;
  calib::Axis x = calib::Axis::X, y = calib::Axis::Y;  ///< the other two, in this order
  /// Edges [m] of three slabs of the same thickness; the cuts are their middles.
  std::array<double, 4> slab_edges_m{};
  /// Edges of the cells [m]. The cells are nearly square: `most` along the longer side, at least 4
  /// along the other.
  std::vector<double> x_edges_m, y_edges_m;

  [[nodiscard]] double cut_m(std::size_t slab) const {
    return 0.5 * (slab_edges_m[slab] + slab_edges_m[slab + 1]);
  }
};
/// The cuts. Requires that `volume` has vertices.
[[nodiscard]] VolumeCuts volume_cuts(const calib::ValidityVolume& volume, std::size_t most);

/// The rms of `left` in each cell of the cuts that add_volume_maps() draws; cells without
/// observations are left out. Empty if the model has no volume.
[[nodiscard]] std::vector<RunFigures::HeldOutCell> held_out_cells(
    const calib::ValidityVolume& volume, std::span<const LeftError> left);

/// Adds one picture that compares before and after compensation, all maps with one colour scale:
/// |V| without compensation in the middle of the volume; U(V), the bound of the remaining error;
/// and, if `held_out` is not empty, the rms of the observations to which the model was not fitted.
void add_before_and_after(HtmlReport& page, const calib::VolumetricModel& model,
                          std::span<const RunFigures::HeldOutCell> held_out = {});

/// Adds maps of the volume: |V| of the machine without compensation, the expanded uncertainty
/// U(V) = 2 sqrt(trace cov V), and, if `held_out` is not empty, the rms of the observations to
/// which the model was not fitted.
void add_volume_maps(HtmlReport& page, const calib::VolumetricModel& model,
                     std::span<const RunFigures::HeldOutCell> held_out = {});

}  // namespace abbe::daemon
