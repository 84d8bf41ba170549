#pragma once
/// The result of `abbe identify joint` as text, JSON and tables of the report.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/calib/joint/contribution.hpp"
#include "abbe/calib/joint/judge.hpp"
#include "abbe/model/model_document.hpp"
#include "joint_input.hpp"

namespace abbe::daemon {

/// A joint model and what it was made of. `input` outlives it.
struct JointOutcome {
  const JointInput& input;
  std::vector<calib::joint::PairTest> pairs;
  std::vector<calib::joint::DirectedTest> directed;
  calib::joint::JointModel joint;
  std::vector<calib::joint::Contribution> contributions;  ///< one per part
  calib::Verdict verdict;
  ModelDocument document;
};

/// The tests of all pairs, also of parts that contradict each other.
[[nodiscard]] nlohmann::json pairs_json(const JointInput&,
                                        const std::vector<calib::joint::PairTest>&);
[[nodiscard]] nlohmann::json directed_json(const JointInput&,
                                           const std::vector<calib::joint::DirectedTest>&);
[[nodiscard]] nlohmann::json joint_json(const JointOutcome&, const std::filesystem::path& folder);
void print_joint_summary(const JointOutcome&, const std::filesystem::path& folder);
/// For the report: the parts, whether they agree, and the uncertainty of each table.
[[nodiscard]] std::vector<RunFigures::Table> joint_tables(const JointOutcome&);

}  // namespace abbe::daemon
