#include "abbe/calib/joint/identify.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "abbe/calib/estimation/datum.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/joint/determining_rows.hpp"
#include "abbe/calib/internal/joint/pair_problem.hpp"
#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/internal/model/misfit_in_V.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"
#include "directed.hpp"
#include "explanations.hpp"

namespace abbe::calib::joint {
namespace {

/// Checks that parts which share an effect state the same standard uncertainty. Necessary because
/// the common unknown is a multiple of it.
Result<void> check_same_effects(std::span<const Part> parts) {
  constexpr double kSame = 1e-6;  // relative; uncertainties in files are decimal numbers
  std::map<std::string, std::pair<double, const Part*>> stated;
  for (const Part& part : parts) {
    if (!part.u_of_effects.empty() && part.u_of_effects.size() != part.effects.size()) {
      return failure(ErrorCode::BadInput,
                     message("joint identification: ", part.name, " has ", part.effects.size(),
                             " effects, but uncertainties of ", part.u_of_effects.size()));
    }
    for (std::size_t k = 0; k < part.u_of_effects.size(); ++k) {
      const double u = part.u_of_effects[k];
      const auto [first, is_new] = stated.try_emplace(part.effects[k], u, &part);
      const auto& [u_first, of_first] = first->second;
      if (!is_new && !(std::abs(u - u_first) <= kSame * u_first)) {
        return failure(
            ErrorCode::BadInput,
            message("joint identification: the uncertainty of '", part.effects[k], "' is ", u_first,
                    " in ", of_first->name, ", ", u, " in ", part.name,
                    ": state the same uncertainty, or another name if it is another cause"));
      }
    }
  }
  return {};
}

Result<void> check_parts(std::span<const Part> parts, const CommonTables& common,
                         std::size_t least) {
  std::set<std::string> names;
  for (const Part& part : parts) {
    if (part.information.unknowns() != common.basis.size() + part.effects.size()) {
      return failure(
          ErrorCode::BadInput,
          message("joint identification: ", part.name, " has ", part.information.unknowns(),
                  " unknowns, not those of ", common.basis.size(), " parameters and ",
                  part.effects.size(), " effects"));
    }
    if (!names.insert(part.name).second) {
      return failure(ErrorCode::BadInput,
                     message("joint identification: two parts have the name ", part.name));
    }
  }
  if (parts.size() < least) {
    return failure(ErrorCode::BadInput,
                   message("joint identification: ", parts.size(), " parts, needs ", least));
  }
  return check_same_effects(parts);
}

Result<void> check_test(std::span<const Part> parts, const CommonTables& common,
                        const JointOptions& options) {
  if (Result<void> valid = check_parts(parts, common, 2); !valid) {
    return valid;
  }
  if (!(options.false_alarm > 0.0 && options.false_alarm < 1.0)) {
    return failure(ErrorCode::BadInput, message("joint identification: false-alarm probability ",
                                                options.false_alarm, " must be in (0, 1)"));
  }
  return {};
}

/// Names of the effects of all parts, without repetition, in the order in which parts name them.
std::vector<std::string> all_effects(std::span<const Part> parts) {
  std::vector<std::string> all;
  for (const Part& part : parts) {
    for (const std::string& name : part.effects) {
      if (std::find(all.begin(), all.end(), name) == all.end()) {
        all.push_back(name);
      }
    }
  }
  return all;
}

/// Name of the table to which a coordinate belongs, or name of an effect.
std::string label_of(std::size_t unknown, const DatumCoordinates& c,
                     const std::vector<std::string>& effects) {
  const auto at = static_cast<Eigen::Index>(unknown);
  for (const DatumGroup& group : c.groups) {
    if (at >= group.first && at < group.first + group.size) {
      return group.name;
    }
  }
  return effects[unknown - static_cast<std::size_t>(c.N.cols())];
}

std::string text_of(const PairTest& t, std::span<const Part> parts) {
  std::string text =
      message(parts[t.i].name, " and ", parts[t.j].name, " contradict each other: chi-square ",
              t.all.statistic, " with ", t.all.dof, " degrees of freedom, p ", t.all.p);
  if (t.explanations.empty()) {
    text += "; no known mistake and no three tables explain it";
    for (std::size_t k = 0; k < t.tables.size(); ++k) {
      text += (k == 0 ? "; largest differences: " : ", ") + joint::text(t.tables[k]);
    }
  }
  for (std::size_t k = 0; k < t.explanations.size(); ++k) {
    text += (k == 0 ? "; they agree if: " : "; or: ") + t.explanations[k].text;
  }
  return text;
}

/// The directed test whose p is farthest below its limit.
const DirectedFinding* most_significant(const std::vector<DirectedFinding>& findings) {
  const auto excess = [](const DirectedFinding& f) {
    return natural_logarithm(f.test.limit) - f.log_p;
  };
  const DirectedFinding* best = nullptr;
  for (const DirectedFinding& f : findings) {
    const bool better = best == nullptr || excess(f) > excess(*best);
    best = f.test.contradiction && better ? &f : best;
  }
  return best;
}

/// Texts as described at JointIdentification::contradictions.
std::vector<std::string> contradictions_of(const std::vector<PairTest>& pairs,
                                           const std::vector<DirectedFinding>& findings,
                                           std::span<const Part> parts) {
  constexpr double kRounding = 1e-6;  // the best explanation of a pair can be the same direction
                                      // with a rounding difference
  const DirectedFinding* directed = most_significant(findings);
  bool first = directed != nullptr && directed->test.explains;
  std::vector<std::string> texts;
  for (const PairTest& pair : pairs) {
    if (pair.contradiction) {
      texts.push_back(text_of(pair, parts));
      first = first && (pair.explanations.empty() ||
                        pair.explanations.front().log_p >= (1.0 + kRounding) * directed->log_p);
    }
  }
  if (directed != nullptr) {  // with three or more parts this test shows which part differs; a pair
                              // test does not
    texts.insert(first ? texts.begin() : texts.end(), text(directed->test, parts));
  }
  return texts;
}

Misfit largest_misfit(std::span<const Part> parts) {
  Misfit largest;
  for (const Part& part : parts) {
    if (part.misfit) {
      largest = larger_misfit(&largest, &*part.misfit);
    }
  }
  return largest;
}

/// Hull of the covered positions of all parts; interior points of large parts are left out.
Result<ValidityVolume> validity_of(std::span<const Part> parts) {
  std::vector<Vector3> covered;
  for (const Part& part : parts) {
    covered.insert(covered.end(), part.covered_m.begin(), part.covered_m.end());
  }
  return ValidityVolume::hull_of(covered);
}

}  // namespace

Result<std::vector<PairTest>> test_pairs(std::span<const Part> parts, const CommonTables& common,
                                         const JointOptions& options) {
  ABBE_TRY(check_test(parts, common, options));

  const DatumCoordinates c = datum_coordinates(common.basis);
  const double pairs = 0.5 * static_cast<double>(parts.size() * (parts.size() - 1));
  const double limit = kShareOfPairs * options.false_alarm / pairs;
  std::vector<PairTest> tests;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (std::size_t j = i + 1; j < parts.size(); ++j) {
      const PairProblem pair(parts[i], parts[j], c);
      const Disagreement d = pair.disagreement();
      PairTest test{.i = i, .j = j, .all = {d.statistic, d.dof, exponential(d.log_p), limit}};
      test.contradiction = d.log_p < natural_logarithm(limit);
      if (test.contradiction) {
        explain(test, pair, parts[i], parts[j], c, common.basis.layout());
      }
      tests.push_back(std::move(test));
    }
  }
  return tests;
}

Result<JointModel> joint_model(std::span<const Part> parts, const CommonTables& common) {
  ABBE_TRY(check_parts(parts, common, 1));

  const DatumCoordinates c = datum_coordinates(common.basis);
  const std::vector<std::string> effects = all_effects(parts);
  const Eigen::Index m = c.N.cols();
  estimation::Information sum(static_cast<std::size_t>(m) + effects.size());
  for (const Part& part : parts) {
    const DeterminingRows rows = in_coordinates(part.information, part.effects, c.N, effects);
    sum.add_rows(rows.A, rows.z);
  }
  for (std::size_t k = 0; k < effects.size(); ++k) {
    sum.add_prior(static_cast<std::size_t>(m) + k, 0.0, 1.0);
  }

  // No datum conditions are needed: the coordinates e already satisfy them.
  const estimation::Datum no_conditions(
      Eigen::MatrixXd(0, static_cast<Eigen::Index>(sum.unknowns())));
  const Result<estimation::DatumSolution> solved = no_conditions.solve(
      sum, {.label = [&](std::size_t unknown) { return label_of(unknown, c, effects); }});
  if (!solved) {
    return failure(solved.error().code, "joint identification: " + solved.error().text);
  }

  Result<ValidityVolume> validity = validity_of(parts);
  ABBE_TRY(validity);
  const Eigen::VectorXd U = c.N * solved->U.head(m);
  const Eigen::MatrixXd of_e = solved->covariance.topLeftCorner(m, m);
  const Eigen::MatrixXd C = c.N * of_e * c.N.transpose();
  Result<VolumetricModel> model =
      VolumetricModel::from_vector(common.basis, ModelDatum::G2, std::array{common.tool_offset_m},
                                   U, 0.5 * (C + C.transpose()), *std::move(validity))
          .and_then([&](const VolumetricModel& of_tables) {
            return of_tables.with_misfit(largest_misfit(parts));
          });
  ABBE_TRY(model);

  JointModel joint{.model = *std::move(model),
                   .effects = {},
                   .rank = solved->rank,
                   .condition = solved->condition};
  for (std::size_t k = 0; k < effects.size(); ++k) {
    const Eigen::Index at = m + static_cast<Eigen::Index>(k);
    joint.effects.push_back(
        {effects[k], solved->U(at), std::sqrt(std::max(0.0, solved->covariance(at, at)))});
  }
  return joint;
}

Result<std::vector<DirectedTest>> test_directions(std::span<const Part> parts,
                                                  const CommonTables& common,
                                                  const JointOptions& options) {
  ABBE_TRY(check_test(parts, common, options));
  std::vector<DirectedTest> tests;
  for (DirectedFinding& f : directed_findings(parts, datum_coordinates(common.basis),
                                              common.basis.layout(), options.false_alarm)) {
    tests.push_back(std::move(f.test));
  }
  return tests;
}

Result<JointIdentification> identify(std::span<const Part> parts, const CommonTables& common,
                                     const JointOptions& options) {
  Result<std::vector<PairTest>> pairs = test_pairs(parts, common, options);
  ABBE_TRY(pairs);

  const std::vector<DirectedFinding> findings = directed_findings(
      parts, datum_coordinates(common.basis), common.basis.layout(), options.false_alarm);
  JointIdentification result{
      .pairs = *std::move(pairs), .directed = {}, .joint = {}, .contradictions = {}};
  result.contradictions = contradictions_of(result.pairs, findings, parts);
  for (const DirectedFinding& f : findings) {
    result.directed.push_back(f.test);
  }
  if (!result.contradictions.empty()) {
    return result;
  }

  Result<JointModel> joint = joint_model(parts, common);
  ABBE_TRY(joint);
  result.joint = *std::move(joint);
  return result;
}

}  // namespace abbe::calib::joint
