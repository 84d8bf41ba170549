#pragma once
/// Continuous calibration: combines the model of a new run with the previous model of the machine.
/// The information of the previous model is reduced according to the time between both. Both are
/// tables in datum G2 with the same parameters (check_same_parameters). In the coordinates e that
/// the conditions of the datum leave free, with G the part of the uncertainty that all runs have in
/// common (UpdateOptions),
///     Cov_previous = (C_previous - G G^T) / forgetting + Q,   Cov_run = C_run - G G^T
///     [ W_previous ]       [ W_previous e_previous ]
///     [   W_run    ] e  =  [      W_run e_run      ],   W^T W = Cov^-1
/// is solved in square-root form (estimation/information.hpp). The covariance of the result,
/// (Cov_previous^-1 + Cov_run^-1)^-1 + G G^T, is never larger than that of the run alone. Without
/// forgetting, process noise and G the result is the adjustment of the rows of both runs,
/// each with its own station of the tracker.
///
/// Process noise Q is a random walk of every table: after t days each node has changed by
/// q sqrt(t) on its own, and the table as a whole by a smooth change (a line, a parabola for
/// straightness) of q sqrt(t) where it is largest. Squareness errors change by q sqrt(t).
///
/// A table that drifted (`renewed`) has no previous information: its values come from the run
/// alone, up to their correlation with the tables that both models know.
///
/// Errors that runs have in common do not average out and must be stated as G; otherwise a hundred
/// runs would reduce their uncertainty to a tenth. G does not contain errors between the nodes,
/// bending, and temperatures that are always wrong by the same amount: their uncertainty is too
/// small after many runs.
///
/// Runs from one place of a tracker have one range offset d. Where both models state it
/// (OffsetInModel), d is an unknown in addition to e, the covariances are those for a known d, and
/// the prior of d is used once:
///     W (e + N^T dU_dd d) = W N^T (U + dU_dd value)   for each model
///     d / u_prior = 0                                     of the prior
///     s d = value / (u^2 s),  s^2 = 1/u^2 - 1/u_prior^2   of the data of each model
/// with s^2 of the previous model times `forgetting`. The offset has no process noise.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/model/offset_in_model.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

/// Process noise of one table or squareness error; replaces the process noise for all.
struct TableNoise {
  std::string table;          ///< such as "EXX", "EC0Y"
  double per_root_day = 0.0;  ///< as length_m_per_root_day or angle_rad_per_root_day
};

struct UpdateOptions {
  /// Factor of the previous information per run, above 0 and at most 1. 1: only process noise
  /// reduces the information.
  double forgetting = 1.0;
  /// Time from the previous model to the run, not negative.
  double days = 0.0;
  /// Process noise: standard deviation of the change of a table in one day. It increases with the
  /// square root of time.
  double length_m_per_root_day = 0.0;
  double angle_rad_per_root_day = 0.0;
  std::vector<TableNoise> of_tables{};
  /// Tables that drifted: the previous model is not used for them.
  std::vector<std::string> renewed{};
  /// Standard uncertainties of errors that all runs have in common: of the scale of the ranges, and
  /// of the length of the scales of X, Y, Z (otf::Noise). Averaging over runs does not reduce them.
  double u_scale = 0.0;
  std::array<double, 3> u_axis_scale{};
};

/// A model, and the range offset that its covariance contains.
struct ModelWithOffset {
  VolumetricModel model;
  std::optional<OffsetInModel> range_offset{};
};

/// Chain, nodes, datum and tool offsets are those of `run`. The validity volume is that of
/// `previous`, and that of `run` if a table is renewed. Pure.
/// NotApplicable as check_same_parameters(), if a model depends on the direction of travel, if a
/// covariance is not larger than the part that is stated as common, or leaves a combination without
/// uncertainty, and if the offset from the data of the run differs from that of the previous model
/// by more than 4 standard uncertainties, because it is then another offset. BadInput for an option
/// out of its range, an unknown table, or an offset of another number of parameters.
///
/// The offset of `previous` must belong to the tracker place of `run`; nullopt: it is not known,
/// and its prior is used. The result has the offset if the run has one.
[[nodiscard]] Result<ModelWithOffset> update_model(const ModelWithOffset& previous,
                                                   const ModelWithOffset& run,
                                                   const UpdateOptions& = {});
/// Combines two models without a common range offset.
[[nodiscard]] Result<VolumetricModel> update_model(const VolumetricModel& previous,
                                                   const VolumetricModel& run,
                                                   const UpdateOptions& = {});

}  // namespace abbe::calib
