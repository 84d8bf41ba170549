#pragma once
/// Figures of a model that the reports of several methods have in common. All numbers are those of
/// the model; none is smoothed.

#include <array>
#include <span>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/model/run_figures.hpp"
#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

/// What is left of one observation to which a model was not fitted, without the rigid motion that
/// fits best to the observations held out together with it (calib/otf/judge/judge.hpp).
struct LeftError {
  calib::Vector3 axis_position_m = calib::Vector3::Zero();
  double before_m = 0.0;  ///< without compensation
  double after_m = 0.0;   ///< with the model
  double sigma_m = 0.0;   ///< standard uncertainty of the observation
};

/// Charts of all tables along their axes with bands of 2 u, as the model interpolates them. Empty
/// for a model of polynomials.
[[nodiscard]] std::vector<LineChart> table_line_charts(const calib::VolumetricModel& model);

/// Three cuts through the validity volume, across the axis of its shortest side.
struct VolumeCuts {
  calib::Axis across = calib::Axis::Z;
  calib::Axis x = calib::Axis::X, y = calib::Axis::Y;  ///< the other two, in this order
  /// Edges [m] of three slabs of the same thickness; the cuts are their middles.
  std::array<double, 4> slab_edges_m{};
  /// Of cells that are nearly square, `most` along the longer side, 4 or more along the other.
  std::vector<double> x_edges_m, y_edges_m;

  [[nodiscard]] double cut_m(std::size_t slab) const {
    return 0.5 * (slab_edges_m[slab] + slab_edges_m[slab + 1]);
  }
};
/// `volume` has vertices.
[[nodiscard]] VolumeCuts volume_cuts(const calib::ValidityVolume& volume, std::size_t most);

/// rms of `left` in the cells of the cuts that add_volume_maps() draws; cells without observations
/// are left out. Empty without a volume.
[[nodiscard]] std::vector<RunFigures::HeldOutCell> held_out_cells(
    const calib::ValidityVolume& volume, std::span<const LeftError> left);

/// Adds one picture before and after: |V| without compensation in the middle of the volume, U(V),
/// which bounds what is left, and, if `held_out` is not empty, the rms of the observations there to
/// which the model was not fitted; all with one colour scale.
void add_before_and_after(HtmlReport& page, const calib::VolumetricModel& model,
                          std::span<const RunFigures::HeldOutCell> held_out = {});

/// Adds maps of the volume: |V| of the machine without compensation, the expanded uncertainty
/// U(V) = 2 sqrt(trace cov V), and, if `held_out` is not empty, the rms of the observations to
/// which the model was not fitted.
void add_volume_maps(HtmlReport& page, const calib::VolumetricModel& model,
                     std::span<const RunFigures::HeldOutCell> held_out = {});

}  // namespace abbe::daemon
