#pragma once
/// The result of a joint identification as text, as JSON and as tables of the report.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "abbe/tasks/identify_joint.hpp"

namespace abbe::daemon {

/// The standard uncertainty as text, "0.123 um", or a text that the tables are not determined.
[[nodiscard]] std::string u_text(const std::optional<double>& u_m);
/// Standard uncertainty of V of the joint model, rms over the nodes.
[[nodiscard]] double u_of_joint_m(const JointOutcome&);
[[nodiscard]] std::string names_of(const JointInput&, const calib::joint::PairTest&);
/// The tests of all pairs, also of parts that contradict each other.
[[nodiscard]] nlohmann::json pairs_json(const JointInput&,
                                        const std::vector<calib::joint::PairTest>&);
[[nodiscard]] nlohmann::json directed_json(const JointInput&,
                                           const std::vector<calib::joint::DirectedTest>&);
[[nodiscard]] nlohmann::json joint_json(const JointOutcome&, const std::filesystem::path& folder);
/// Tables for the report: the parts, their agreement, and the uncertainty of each table.
[[nodiscard]] std::vector<RunFigures::Table> joint_tables(const JointOutcome&);

}  // namespace abbe::daemon
