#include "abbe/tasks/joint_report.hpp"

#include <fmt/format.h>

#include "abbe/base/units.hpp"
#include "abbe/calib/otf/judge/lack_of_fit.hpp"
#include "abbe/report/sections.hpp"
#include "abbe/tasks/identified_model.hpp"

namespace abbe::daemon {

std::string u_text(const std::optional<double>& u_m) {
  return u_m ? um_text(*u_m, 3) : "not determined";
}

double u_of_joint_m(const JointOutcome& outcome) {
  return calib::otf::correction_size(outcome.joint.model).u_m;
}

std::string names_of(const JointInput& input, const calib::joint::PairTest& pair) {
  return fmt::format("{} and {}", input.parts[pair.i].name, input.parts[pair.j].name);
}

namespace {

using calib::joint::DirectedTest;
using calib::joint::PairTest;
using calib::joint::TableUncertainty;

nlohmann::json u_json(const std::optional<double>& u_m) {
  return u_m ? nlohmann::json(*u_m * kUmPerM) : nlohmann::json();
}

nlohmann::json parts_json(const JointOutcome& outcome) {
  nlohmann::json parts = nlohmann::json::array();
  for (std::size_t k = 0; k < outcome.input.facts.size(); ++k) {
    const PartFacts& part = outcome.input.facts[k];
    const auto& share = outcome.contributions[k];
    parts.push_back({{"name", part.name},
                     {"method", part.method},
                     {"observations", part.observations},
                     {"u_alone_um", u_json(share.u_alone_m)},
                     {"u_without_um", u_json(share.u_without_m)},
                     {"gate_alone", verdict_json(part.verdict)}});
  }
  return parts;
}

/// Standard uncertainty of each table, in the model of every run and in the joint model.
struct TableRow {
  TableUncertainty joint;
  std::vector<double> u_of_runs;
};
std::vector<TableRow> table_rows(const JointOutcome& outcome) {
  std::vector<TableRow> rows;
  for (const TableUncertainty& t : calib::joint::table_uncertainties(outcome.joint.model))
    rows.push_back({t, {}});
  for (const PartFacts& part : outcome.input.facts) {
    if (!part.own_model) continue;
    const auto own = calib::joint::table_uncertainties(*part.own_model);
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i].u_of_runs.push_back(own[i].u);
  }
  return rows;
}

nlohmann::json tables_json(const JointOutcome& outcome) {
  nlohmann::json tables = nlohmann::json::array();
  for (const TableRow& row : table_rows(outcome)) {
    std::vector<double> u;
    for (const double of_run : row.u_of_runs) u.push_back(of_run * kUmPerM);
    tables.push_back({{"table", row.joint.table},
                      {"unit", row.joint.is_angle ? "urad" : "um"},
                      {"u_of_runs", u},
                      {"u", row.joint.u * kUmPerM}});
  }
  return tables;
}

RunFigures::Table parts_table(const JointOutcome& outcome) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t k = 0; k < outcome.input.facts.size(); ++k) {
    const PartFacts& part = outcome.input.facts[k];
    const auto& share = outcome.contributions[k];
    rows.push_back({part.name, part.method, part.files, fmt::to_string(part.observations),
                    u_text(share.u_alone_m), u_text(share.u_without_m)});
  }
  rows.push_back({"all parts", "joint", "", "", um_text(u_of_joint_m(outcome), 3), ""});
  return {.title = "Parts",
          .explanation =
              "u: standard uncertainty of V over the nodes, rms, without a rigid motion of the "
              "whole volume; of the part alone, and of all other parts together.",
          .columns = {"part", "method", "files", "observations", "u alone", "u without it"},
          .rows = std::move(rows)};
}

RunFigures::Table pairs_table(const JointOutcome& outcome) {
  std::vector<std::vector<std::string>> rows;
  for (const PairTest& pair : outcome.pairs)
    rows.push_back({names_of(outcome.input, pair), fmt::format("{:.2f}", pair.all.statistic),
                    fmt::to_string(pair.all.dof), fmt::format("{:.3g}", pair.all.p),
                    fmt::format("{:.3g}", pair.all.limit)});
  return {.title = "Do the parts agree?",
          .explanation =
              "Each pair is tested in all combinations of parameters that both parts determine. p: "
              "probability of a larger chi-square if both describe the same machine.",
          .columns = {"pair", "chi-square", "degrees of freedom", "p", "refused below"},
          .rows = std::move(rows)};
}

std::string unit_of(const DirectedTest& test) {
  return test.is_angle ? "urad" : "um/m";
}

RunFigures::Table directed_table(const JointOutcome& outcome) {
  std::vector<std::vector<std::string>> rows;
  for (const DirectedTest& test : outcome.directed)
    rows.push_back(
        {outcome.input.parts[test.part].name, fmt::format("{}, {}", test.direction, unit_of(test)),
         fmt::format("{:.3f}", test.difference * kUmPerM), fmt::format("{:.3f}", test.u * kUmPerM),
         fmt::format("{:.3g}", test.p), fmt::format("{:.3g}", test.limit)});
  return {.title = "Lengths, scales and squareness of the parts",
          .explanation =
              "Difference of a part from all other parts together, with its standard uncertainty. "
              "p: probability of a larger difference if all describe the same machine.",
          .columns = {"part", "direction", "difference", "u", "p", "refused below"},
          .rows = std::move(rows)};
}

RunFigures::Table uncertainties_table(const JointOutcome& outcome) {
  std::vector<std::string> columns{"rms over the nodes"};
  for (const PartFacts& part : outcome.input.facts)
    if (part.own_model) columns.push_back(part.name);
  columns.emplace_back("all parts");
  std::vector<std::vector<std::string>> rows;
  for (const TableRow& row : table_rows(outcome)) {
    std::vector<std::string> cells{
        fmt::format("{}, {}", row.joint.table, row.joint.is_angle ? "urad" : "um")};
    for (const double u : row.u_of_runs) cells.push_back(fmt::format("{:.3f}", u * kUmPerM));
    cells.push_back(fmt::format("{:.3f}", row.joint.u * kUmPerM));
    rows.push_back(std::move(cells));
  }
  return {.title = "Standard uncertainty of each table",
          .explanation = {},
          .columns = std::move(columns),
          .rows = std::move(rows)};
}

std::vector<std::string> texts_of(const std::vector<calib::joint::Explanation>& explanations) {
  std::vector<std::string> texts;
  for (const auto& explanation : explanations) texts.push_back(explanation.text);
  return texts;
}

}  // namespace

nlohmann::json directed_json(const JointInput& input, const std::vector<DirectedTest>& directed) {
  nlohmann::json all = nlohmann::json::array();
  for (const DirectedTest& test : directed)
    all.push_back({{"part", input.parts[test.part].name},
                   {"direction", test.direction},
                   {"unit", unit_of(test)},
                   {"difference", test.difference * kUmPerM},
                   {"u", test.u * kUmPerM},
                   {"p", test.p},
                   {"limit", test.limit},
                   {"contradiction", test.contradiction}});
  return all;
}

nlohmann::json pairs_json(const JointInput& input, const std::vector<PairTest>& pairs) {
  nlohmann::json all = nlohmann::json::array();
  for (const PairTest& pair : pairs)
    all.push_back({{"parts", {input.parts[pair.i].name, input.parts[pair.j].name}},
                   {"chi2", pair.all.statistic},
                   {"dof", pair.all.dof},
                   {"p", pair.all.p},
                   {"limit", pair.all.limit},
                   {"contradiction", pair.contradiction},
                   {"explanations", texts_of(pair.explanations)}});
  return all;
}

nlohmann::json joint_json(const JointOutcome& outcome, const std::filesystem::path& folder) {
  const auto& held_out = outcome.verdict.held_out;
  nlohmann::json effects = nlohmann::json::array();
  for (const auto& effect : outcome.joint.effects)
    effects.push_back({{"name", effect.name}, {"value", effect.value}, {"u", effect.u}});
  return {{"model", (folder / "model.json").string()},
          {"id", model_id(outcome.document)},
          {"hash", model_hash(outcome.document)},
          {"parts", parts_json(outcome)},
          {"pairs", pairs_json(outcome.input, outcome.pairs)},
          {"directed", directed_json(outcome.input, outcome.directed)},
          {"u_um", u_of_joint_m(outcome) * kUmPerM},
          {"tables", tables_json(outcome)},
          {"effects", effects},
          {"rank", outcome.joint.rank},
          {"condition", outcome.joint.condition},
          {"held_out_rms_before_um", held_out.no_compensation_rms_m * kUmPerM},
          {"held_out_rms_after_um", held_out.candidate_rms_m * kUmPerM},
          {"gate", verdict_json(outcome.verdict)}};
}

std::vector<RunFigures::Table> joint_tables(const JointOutcome& outcome) {
  return {parts_table(outcome), pairs_table(outcome), directed_table(outcome),
          uncertainties_table(outcome)};
}

}  // namespace abbe::daemon
