#pragma once
/// Identifies one model from several runs, ball arrays and bars that agree with each other.

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "abbe/calib/joint/contribution.hpp"
#include "abbe/calib/joint/judge.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tasks/joint_input.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// A joint model, and its input.
struct JointOutcome {
  JointInput input;
  std::vector<calib::joint::PairTest> pairs;
  std::vector<calib::joint::DirectedTest> directed;
  calib::joint::JointModel joint;
  std::vector<calib::joint::Contribution> contributions;  ///< one per part
  calib::Verdict verdict;
  ModelDocument document;
};

/// The result if parts contradict each other: there is no joint model.
struct JointContradiction {
  JointInput input;
  calib::joint::JointIdentification identified;  ///< result with the tests and the contradictions
};

/// Errors are those of read_joint_input(). A JointContradiction is not an error, because its tests
/// are a result.
[[nodiscard]] Result<std::variant<JointOutcome, JointContradiction>> identify_joint(
    const IdentifyJointArguments&, const Progress&);

}  // namespace abbe::daemon
