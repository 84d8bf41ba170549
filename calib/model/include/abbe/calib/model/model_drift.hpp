#pragma once
/// Has the machine changed since the active model was identified? Tests a model of a new run
/// against the active one. Both are tables in datum G2, with the same axes, nodes and tools; the
/// difference of their parameters then has no part that no measurement shows:
///     d = U_new - U_active,   C = C_new + C_active,   d ~ N(0, C) if nothing changed
/// C is regular in the coordinates that the conditions of the datum leave free; combinations for
/// which both models state no uncertainty (singular values of the scaled C below 1e-10 of the
/// largest) are not tested.
///
/// A test of a table, [Baarda 1968]: how much chi-square does d lose if this table alone may have
/// changed? With the whitened difference w and the whitened columns W of the table
///     X2 = |P w|^2,   P: projection onto the columns W
/// which is chi-square with rank(W) degrees of freedom if nothing changed. The other tables are
/// taken as unchanged, because the uncertainty of one table in datum G2 contains that of all the
/// others. The tests:
/// - squareness: its value; positioning and rotations: a line through the reference; straightness:
///   a parabola. One degree of freedom each: a change of scale or a bow is the most frequent.
/// - every table: any change;
/// - all tables together.
/// The table with the most significant test is taken as changed, and the others are tested again
/// with it free, until no test exceeds its limit.
///
/// False alarms: the limits of all first tests sum to DriftOptions::false_alarm (Bonferroni), nine
/// tenths for those with one degree of freedom. So an unchanged machine gives an alarm with at
/// most this probability per run, whatever the tests have in common, and n runs with n times this:
/// 2e-4 keeps 100 runs without an alarm with a probability of 0.98, also where all of them are
/// compared with the same active model. The tests after the first alarm do not add to it.
///
/// Power, with 17 tests of one degree of freedom: a change of 6 standard deviations of the
/// difference in one combination alone (a scale, where the uncertainty of the scales is all of it)
/// is found with a probability of 0.945; in a combination that the other tables help to determine
/// more surely.
///
/// What C leaves out, and the side on which that errs:
/// - Errors that both runs have in common (calibration of the tracker's ranges, expansion factor of
///   the scales, refraction at the same place) are in C_new and in C_active as if they were
///   independent: C is too large, and a change of scale is found later. No false alarm follows.
/// - Errors between nodes: tables of runs on the same path contain the same; tables of different
///   paths can differ by them, and C does not contain it. Compare runs on the same path.
/// - Tool offsets may differ by VolumetricModel::kToolTolerance_m, which changes V by up to 0.05
///   um.
/// - Which table changed is the simplest explanation of d: of two tables whose effects on the path
///   are similar the wrong one may be named. That something changed does not depend on it.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/model/gate.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

struct DriftOptions {
  /// Probability of an alarm in a run of an unchanged machine. 2e-4: 100 runs without an alarm with
  /// probability 0.98.
  double false_alarm = 2e-4;
};

struct ChiSquare {
  double statistic = 0.0;
  std::size_t dof = 0;
  double p = 1.0;      ///< probability of a larger value if nothing changed
  double limit = 0.0;  ///< an alarm if p is smaller
};

/// A table or a squareness error.
struct TableChange {
  std::string table;  ///< "EXX", "EC0Y"
  bool drifted = false;
  bool smooth = false;  ///< `test` is that of a line or parabola, else of any change
  /// The most significant test. Of a drifted table: when it was found; of others: with all drifted
  /// tables free.
  ChiSquare test;
  /// Estimated change (new minus active) where it is largest, m or rad, with its standard
  /// uncertainty; this table and the drifted ones free, the others unchanged.
  double change = 0.0, u = 0.0;
  std::optional<double> position_m{};  ///< its place on the axis; nullopt: squareness
  bool is_angle = false;
};
/// "EXX changed by 4.2 um at 300 mm (standard uncertainty 0.5 um): chi-square 70.6 with 1 degree of
/// freedom, p 4.4e-17".
[[nodiscard]] std::string text(const TableChange&);

struct DriftTest {
  std::vector<TableChange> tables;  ///< in the order of the parameters
  ChiSquare all;                    ///< of all differences
  /// Of what is left with the drifted tables free. Below its limit: no single tables explain the
  /// change.
  ChiSquare rest;
  std::size_t untested = 0;  ///< combinations for which no model states an uncertainty
  bool drifted = false;      ///< any test was beyond its limit

  [[nodiscard]] std::vector<std::string> drifted_tables() const;
};
/// "EXX by 4.2 um at 300 mm (u 0.5 um), EC0Y by -9 urad (u 1 urad)": the most significant changes,
/// and how many more there are; or that no single table explains the change. Empty without drift.
[[nodiscard]] std::string text(const DriftTest&);

/// NotApplicable, with the first difference: one of the models is no table in datum G2, or they
/// have other axes, tables, nodes, references or tools. Parameters of both can then not be compared
/// one by one.
[[nodiscard]] Result<void> check_same_parameters(const VolumetricModel& a,
                                                 const VolumetricModel& b);

/// Pure. NotApplicable as above, and if neither model states an uncertainty; BadInput for a
/// false_alarm that is not between 0 and 1.
[[nodiscard]] Result<DriftTest> test_drift(const VolumetricModel& run,
                                           const VolumetricModel& active, const DriftOptions& = {});

/// True if a run is evidence about the machine although the gate may have refused its model: it
/// predicts better than no compensation, and every reason compares it with the active model
/// (held-out, volume, scale-change). An unchanged or little changed machine is refused so.
[[nodiscard]] bool shows_machine(const Verdict&);

}  // namespace abbe::calib
