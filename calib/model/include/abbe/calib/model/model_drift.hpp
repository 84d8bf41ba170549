#pragma once
/// Tests whether the machine has changed since the active model was identified, with a model of a
/// new run. Both models are tables in datum G2, with the same axes, nodes and tools. Measurements
/// then determine every part of the difference of their parameters:
///     d = U_new - U_active,   C = C_new + C_active,   d ~ N(0, C) if nothing changed
/// C is regular in the coordinates that the conditions of the datum leave free; combinations for
/// which both models state no uncertainty (singular values of the scaled C below 1e-10 of the
/// largest) are not tested.
///
/// The test of a table, [Baarda 1968], computes the decrease of the chi-square of d if this table
/// alone may have changed. With the whitened difference w and the whitened columns W of the table
///     X2 = |P w|^2,   P: projection onto the columns W
/// which is chi-square with rank(W) degrees of freedom if nothing changed. The other tables are
/// taken as unchanged, because the uncertainty of one table in datum G2 contains that of all the
/// others. The tests:
/// - squareness: its value; positioning and rotations: a line through the reference; straightness:
///   a parabola. One degree of freedom each, because a change of scale and a bow are the most
///   frequent changes.
/// - every table: any change of its values;
/// - all tables together.
/// The table with the most significant test is taken as changed: its values become free parameters.
/// Then the other tables are tested again, until no test exceeds its limit.
///
/// False alarms: the limits of all first tests sum to DriftOptions::false_alarm (Bonferroni), nine
/// tenths for those with one degree of freedom. An unchanged machine therefore gives an alarm with
/// at most this probability per run, also if the tests are correlated; n runs give one with at most
/// n times this probability. With 2e-4, 100 runs give no alarm with a probability of 0.98, also if
/// all of them are compared with the same active model. The tests after the first alarm do not
/// increase this probability.
///
/// Power, with 17 tests of one degree of freedom: a change of 6 standard deviations of the
/// difference in one combination alone (for example a scale, if its uncertainty consists only of
/// that of the scales) is found with a probability of 0.945. The probability is larger for a
/// combination that the other tables help to determine.
///
/// Effects that C does not describe correctly, and their consequence:
/// - Errors that both runs have in common (calibration of the tracker's ranges, expansion factor of
///   the scales, refraction at the same place) are in C_new and in C_active as if they were
///   independent: C is too large, and a change of scale is found later. This causes no false alarm.
/// - Errors between nodes: they change the tables of runs on the same path by the same amount.
///   Tables of different paths can differ by them, and C does not contain this. Compare runs on the
///   same path.
/// - Tool offsets may differ by VolumetricModel::kToolTolerance_m, which changes V by up to 0.05
///   um.
/// - The named table is the simplest explanation of d. If two tables have similar effects on the
///   path, the wrong one may be named; the finding that the machine changed remains valid.

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
  double p = 1.0;      ///< probability of a larger value if the machine has not changed
  double limit = 0.0;  ///< a p below this limit is an alarm
};

/// Test result of one table or squareness error.
struct TableChange {
  std::string table;  ///< such as "EXX", "EC0Y"
  bool drifted = false;
  bool smooth = false;  ///< true: `test` is that of a line or parabola; false: of any change
  /// The most significant test of this table. For a drifted table: the test that found it. For
  /// other tables: the test with the values of all drifted tables free.
  ChiSquare test;
  /// Estimated change (new minus active) at the position where it is largest, m or rad, with its
  /// standard uncertainty. Estimated with this table and the drifted tables free and all others
  /// unchanged.
  double change = 0.0, u = 0.0;
  std::optional<double> position_m{};  ///< position on the axis; nullopt: squareness
  bool is_angle = false;
};
/// Text such as "EXX changed by 4.2 um at 300 mm (standard uncertainty 0.5 um): chi-square 70.6
/// with 1 degree of freedom, p 4.4e-17".
[[nodiscard]] std::string text(const TableChange&);

struct DriftTest {
  std::vector<TableChange> tables;  ///< in the order of the parameters
  ChiSquare all;                    ///< test of all differences together
  /// Test of the differences that remain with the drifted tables free. If it exceeds its limit,
  /// single tables do not explain the change.
  ChiSquare rest;
  std::size_t untested = 0;  ///< number of combinations for which no model states an uncertainty
  bool drifted = false;      ///< true if any test exceeded its limit

  [[nodiscard]] std::vector<std::string> drifted_tables() const;
};
/// Text such as "EXX by 4.2 um at 300 mm (u 0.5 um), EC0Y by -9 urad (u 1 urad)": the most
/// significant changes and the number of further ones, or the statement that no single table
/// explains the change. Empty without drift.
[[nodiscard]] std::string text(const DriftTest&);

/// Checks that the parameters of both models can be compared one by one. NotApplicable, with the
/// first difference, if a model has no tables in datum G2, or if axes, tables, nodes, references or
/// tools differ.
[[nodiscard]] Result<void> check_same_parameters(const VolumetricModel& a,
                                                 const VolumetricModel& b);

/// Compares the model of a run with the active model. Pure. NotApplicable as
/// check_same_parameters(), and if neither model states an uncertainty; BadInput for a false_alarm
/// that is not between 0 and 1.
[[nodiscard]] Result<DriftTest> test_drift(const VolumetricModel& run,
                                           const VolumetricModel& active, const DriftOptions& = {});

/// True if a run is evidence about the state of the machine although the gate may have refused its
/// model. Conditions: its model predicts better than no compensation, and every reason of the
/// refusal compares it with the active model (held-out, volume, scale-change). The gate refuses a
/// run of an unchanged machine for such reasons.
[[nodiscard]] bool shows_machine(const Verdict&);

}  // namespace abbe::calib
