#pragma once
/// Joint identification: one model from several parts (part.hpp) that were tested against each
/// other before. With R_k, z_k of the parts, all parts together minimise
///     sum_k |R_k x - z_k|^2 + |effects|^2,    x = (e, effects),   U = N e in gauge G2
/// The information is a sum, so the covariance of the result is never larger than that of a part
/// alone (as matrices), and neither is the uncertainty of V at any position.
///
/// Test of two parts i, j: how much larger is the minimum of both together than the sum of their own
/// minima?
///     X2 = min(i + j + priors of shared effects) - min(i) - min(j)
/// X2 is chi-square with rank(i) + rank(j) + (shared effects) - rank(i + j) degrees of freedom if
/// both describe one machine. It is the chi-square of the difference over all combinations of
/// parameters that both determine; combinations that one part alone determines do not contribute.
/// An estimated noise (Part::dof_of_noise) may be too small: X2 is divided by the factor by which
/// its variance exceeds the estimate with a probability of 2 %,
///     1 / (1 - s - 2.054 sqrt(s))^3,   s = 2 / (9 dof)    [Wilson 1931], at most 1000
/// The covariance of the joint model is not widened for a noise that is known only to some percent.
///
/// Explanations of a contradiction: all that leave an X2 whose probability is larger than 1e-3 and
/// than the limit of the test, in this order:
/// - mistakes without unknowns, at most three, most likely first: the sign of a whole part or of
///   one table, the unit of a part, the mistakes of its method (axes, tool);
/// - one common factor of all lengths (temperature, expansion, unit, ranges of the tracker);
/// - tables that differ, at most three: each is the table that decreases X2 most significantly with
///   those before it free, until the rest is likely.
/// Two parts alone do not show which of them is wrong.
///
/// All functions are pure and may be called from any thread; Part::mistakes is called on the thread
/// of the caller. The text of an error starts with "joint identification: ".

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/joint/part.hpp"
#include "abbe/calib/model_drift.hpp"

namespace abbe::calib::joint {

struct JointOptions {
  /// Probability that parts of one machine are refused. All pairs together have this probability
  /// (Bonferroni).
  double false_alarm = 1e-3;
};

/// A table or squareness error in which two parts differ.
struct TableDifference {
  std::string table;  ///< "EXX", "EC0Y"
  /// j minus i where it is largest, m or rad, with its standard uncertainty; the other tables alike.
  double difference = 0.0, u = 0.0;
  std::optional<double> position_m{};  ///< on the axis; nullopt: squareness
  bool is_angle = false;
  ChiSquare test;  ///< by how much X2 decreases if this table may differ
};
/// "EXX by 4.2 um at 300 mm (u 0.5 um)"
[[nodiscard]] std::string text(const TableDifference&);

struct PairTest {
  std::size_t i = 0, j = 0;  ///< indices of the parts
  ChiSquare all;             ///< statistic, degrees of freedom, p, limit
  bool contradiction = false;
  /// Of a contradiction: what makes both agree (mistakes, length, tables); else empty.
  std::vector<std::string> explanations{};
  std::vector<TableDifference> tables{};  ///< of a contradiction: the most significant, at most 3
};

/// Tests all pairs. BadInput for fewer than two parts, names that repeat, parts with another
/// number of parameters, a false-alarm probability that is not between 0 and 1, or an effect that
/// two parts state with different uncertainties.
[[nodiscard]] Result<std::vector<PairTest>> test_pairs(std::span<const Part>, const CommonTables&,
                                                       const JointOptions& = {});

struct EffectEstimate {
  std::string name;
  double value = 0.0, u = 0.0;  ///< in units of its stated standard uncertainty
};

struct JointModel {
  VolumetricModel model;  ///< gauge G2, for the tool of the common tables
  std::vector<EffectEstimate> effects;
  std::size_t rank = 0;
  double condition = 0.0;
};
/// The model of all parts, tested or not: the caller tests them before. RankDeficient if all parts
/// together leave a combination undetermined; the text names parameters. BadInput as test_pairs(),
/// for no part at all, and if the covered positions of all parts span no volume.
[[nodiscard]] Result<JointModel> joint_model(std::span<const Part>, const CommonTables&);

struct JointIdentification {
  std::vector<PairTest> pairs;
  /// nullopt if a pair contradicts each other: parts are never averaged then.
  std::optional<JointModel> joint;
  /// Of each contradiction: "run 1 and array contradict each other (chi-square ...): ...".
  std::vector<std::string> contradictions;
};
/// Tests all pairs, and computes the model if no pair contradicts each other. A contradiction is a
/// result, not an error. Errors as test_pairs() and joint_model().
[[nodiscard]] Result<JointIdentification> identify(std::span<const Part>, const CommonTables&,
                                                   const JointOptions& = {});

}  // namespace abbe::calib::joint
