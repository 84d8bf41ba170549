#pragma once
/// Joint identification: one model from several parts (part.hpp) that were tested against each
/// other before. With R_k, z_k of the parts, all parts together minimise
///     sum_k |R_k x - z_k|^2 + |effects|^2,    x = (e, effects),   U = N e in datum G2
/// The information is a sum, so the covariance of the result is never larger than that of a part
/// alone (as matrices), and neither is the uncertainty of V at any position.
///
/// Test of two parts i, j: X2 is the increase of the minimum of both together over the sum of their
/// own minima.
///     X2 = min(i + j + priors of shared effects) - min(i) - min(j)
/// X2 is chi-square with rank(i) + rank(j) + (shared effects) - rank(i + j) degrees of freedom if
/// both describe one machine. It is the chi-square of the difference over all combinations of
/// parameters that both determine; combinations that one part alone determines do not contribute.
/// An estimated noise (Part::dof_of_noise) may be too small: X2 is divided by the factor by which
/// its variance exceeds the estimate with a probability of 2 %,
///     1 / (1 - s - 2.054 sqrt(s))^3,   s = 2 / (9 dof)    [Wilson 1931], at most 1000
/// The covariance of the joint model is not widened for a noise that is known only to some percent.
///
/// Directed tests. X2 has many degrees of freedom, so that a difference of one kind adds little to
/// it. A difference of the most frequent kinds is therefore tested by itself: one factor of all
/// lengths (temperature, calibration, ranges of the tracker), the scale of X, Y, Z, and the three
/// squareness errors. Part k observes e + a d, all other parts e (a: effect of the direction); d is
/// estimated in the adjustment of all parts, with its standard uncertainty u and the degrees of
/// freedom of u, and |d| / u is compared with the quantile of Student's t. Two parts have one such
/// test for each direction. n > 2 parts have n tests, each part against all others, so that the
/// tests also show which part differs.
///
/// False alarms: the limits of all tests sum to JointOptions::false_alarm (Bonferroni): 70 % for
/// the directed tests of the length, the most frequent mistake, 20 % for those of scales and
/// squareness, 10 % for X2 of the pairs. With the default a length error of 5 u between two parts
/// is found with a probability of 0.96.
///
/// Explanations of a contradiction are all hypotheses after which the probability of the remaining
/// X2 is larger than 1e-3 and than the limit of the test. The first explanation is the best one:
/// its improvement of X2 is least likely to occur by chance (Explanation::log_p).
/// - mistakes without unknowns, at most three: the sign of a whole part or of one table, the unit
///   of a part, the mistakes of its method (axes reversed or swapped, tool);
/// - a difference in one direction, the one that fits best;
/// - tables that differ, at most three. Each further table is the one that decreases X2 most
///   significantly, with the tables found before it free. The search ends when the remaining X2 is
///   likely.
/// Two parts alone do not show which of them is wrong.
///
/// All functions are pure and may be called from any thread; Part::mistakes is called on the thread
/// of the caller. The text of an error starts with "joint identification: ".

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/joint/part.hpp"
#include "abbe/calib/model/model_drift.hpp"

namespace abbe::calib::joint {

struct JointOptions {
  /// Probability that parts of one unchanged machine are refused. All tests together have at most
  /// this probability (Bonferroni). With 2e-3, 100 correct sets of parts are all accepted with a
  /// probability of 0.82 or more.
  double false_alarm = 2e-3;
};

/// A table or squareness error in which two parts differ.
struct TableDifference {
  std::string table;  ///< such as "EXX", "EC0Y"
  /// Value of part j minus part i at the position where it is largest, m or rad, with its standard
  /// uncertainty. Estimated with all other tables equal in both parts.
  double difference = 0.0, u = 0.0;
  std::optional<double> position_m{};  ///< position on the axis; nullopt: squareness
  bool is_angle = false;
  ChiSquare test;  ///< test of the decrease of X2 if this table may differ
};
/// Text such as "EXX by 4.2 um at 300 mm (u 0.5 um)".
[[nodiscard]] std::string text(const TableDifference&);

/// A hypothesis under which two contradicting parts agree.
struct Explanation {
  std::string text;
  /// Logarithm of the probability that the improvement occurs by chance: tail of chi-square with as
  /// many degrees of freedom as unknowns. A mistake without unknowns counts as one unknown.
  double log_p = 0.0;
};

struct PairTest {
  std::size_t i = 0, j = 0;  ///< indices of the parts
  ChiSquare all;             ///< the test of X2
  bool contradiction = false;
  /// For a contradiction: mistakes, directions and tables that explain it, best first; else empty.
  std::vector<Explanation> explanations{};
  std::vector<TableDifference> tables{};  ///< for a contradiction: the tables that differ most
                                          ///< significantly, at most 3
};

inline constexpr const char* kLength = "length";  ///< a value of DirectedTest::direction

/// Test whether one part differs from all others in one direction.
struct DirectedTest {
  std::size_t part = 0;   ///< index of the part
  std::string direction;  ///< kLength, or such as "scale of X", "EC0Y"
  bool is_angle = false;  ///< true: difference in rad, false: relative
  /// Value of the part minus that of all others, with its standard uncertainty.
  double difference = 0.0, u = 0.0;
  double dof = 0.0;  ///< degrees of freedom of u; 0: all uncertainties were stated
  double p = 1.0, limit = 0.0;
  bool contradiction = false;
  bool explains = false;  ///< true if all parts agree when this part may differ in this direction
};
/// Text such as "array: its lengths are larger by 20.3 um/m (u 1.7 um/m, p 1e-12) than those of
/// run: wrong length or temperature of the array, or wrong scale of the tracker's ranges".
[[nodiscard]] std::string text(const DirectedTest&, std::span<const Part>);

/// Tests all pairs. BadInput for fewer than two parts, names that repeat, parts with another
/// number of parameters, a false-alarm probability that is not between 0 and 1, or an effect that
/// two parts state with different uncertainties.
[[nodiscard]] Result<std::vector<PairTest>> test_pairs(std::span<const Part>, const CommonTables&,
                                                       const JointOptions& = {});

/// Tests all directions that the parts determine. Errors as test_pairs().
[[nodiscard]] Result<std::vector<DirectedTest>> test_directions(std::span<const Part>,
                                                                const CommonTables&,
                                                                const JointOptions& = {});

struct EffectEstimate {
  std::string name;
  double value = 0.0, u = 0.0;  ///< multiples of the effect's stated standard uncertainty
};

struct JointModel {
  VolumetricModel model;  ///< datum G2, for the tool of the common tables
  std::vector<EffectEstimate> effects;
  std::size_t rank = 0;
  double condition = 0.0;
};
/// Computes the model of all parts without testing them: the caller tests them before.
/// RankDeficient if all parts together leave a combination undetermined; the text names parameters.
/// BadInput as test_pairs(), for no part at all, and if the covered positions of all parts span no
/// volume.
[[nodiscard]] Result<JointModel> joint_model(std::span<const Part>, const CommonTables&);

struct JointIdentification {
  std::vector<PairTest> pairs;
  std::vector<DirectedTest> directed;
  /// nullopt if a test found a contradiction: contradicting parts are not combined.
  std::optional<JointModel> joint;
  /// Texts in this order: the most significant directed test, if it explains all contradictions and
  /// fits better than any other explanation; each contradicting pair ("run 1 and array contradict
  /// each other: chi-square ..."); the most significant directed test, if it is not the first text.
  std::vector<std::string> contradictions;
};
/// Tests all pairs and directions, and computes the model if there is no contradiction. A
/// contradiction is a result, not an error. Errors as test_pairs() and joint_model().
[[nodiscard]] Result<JointIdentification> identify(std::span<const Part>, const CommonTables&,
                                                   const JointOptions& = {});

}  // namespace abbe::calib::joint
