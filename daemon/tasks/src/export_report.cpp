#include "abbe/tasks/export_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

double largest_of(const std::vector<double>& values) {
  double largest = 0.0;
  for (const double value : values) largest = std::max(largest, std::abs(value));
  return largest;
}

std::string table_line(const calib::HeldTable& table) {
  const bool angle = calib::is_rotation(table.motion.motion);
  std::string line =
      fmt::format("  {:<5}{:>6} nodes, largest {:.3f} {}", calib::name(table.motion),
                  table.value.size(), largest_of(table.value) * kUmPerM, angle ? "urad" : "um");
  if (!table.half_forward.empty())
    line += fmt::format(", difference of the directions up to {:.3f} {}",
                        2.0 * largest_of(table.half_forward) * kUmPerM, angle ? "urad" : "um");
  return line + "\n";
}

std::string held_text(const HeldCorrection& held) {
  std::string text = "\nheld:\n";
  if (const auto* grid = std::get_if<calib::HeldGrid>(&held); grid != nullptr)
    return text + fmt::format("  grid of {} x {} x {} nodes\n", grid->axes_m[0].size(),
                              grid->axes_m[1].size(), grid->axes_m[2].size());
  for (const auto& table : std::get<calib::HeldTables>(held).tables) {
    if (largest_of(table.value) > 0.0 || largest_of(table.half_forward) > 0.0)
      text += table_line(table);
  }
  return text;
}

std::string loss_text(const calib::ExportLoss& loss) {
  std::string text =
      "\ncorrection over the volume, um:\n"
      "  axis   of the model          lost by the file\n"
      "            rms       max         rms       max\n";
  for (Eigen::Index a = 0; a < 3; ++a)
    text += fmt::format("  {:<5}{:>8.3f}  {:>8.3f}    {:>8.3f}  {:>8.3f}\n", "xyz"[a],
                        loss.rms_without_m[a] * kUmPerM, loss.max_without_m[a] * kUmPerM,
                        loss.rms_lost_m[a] * kUmPerM, loss.max_lost_m[a] * kUmPerM);
  return text;
}

std::string by_error_text(const std::vector<calib::ErrorLoss>& losses) {
  if (losses.empty()) return {};
  std::string text =
      "\nerrors of the model, effect over the volume, um:\n"
      "  error  effect rms    lost rms    lost max\n";
  for (const auto& loss : losses)
    text += fmt::format("  {:<5}{:>12.3f}{:>12.3f}{:>12.3f}\n", loss.name, loss.rms_m * kUmPerM,
                        loss.rms_lost_m * kUmPerM, loss.max_lost_m * kUmPerM);
  return text;
}

nlohmann::json in_um(const calib::Vector3& v_m) {
  const calib::Vector3 v = kUmPerM * v_m;
  return {v[0], v[1], v[2]};
}

nlohmann::json tables_json(const HeldCorrection& held) {
  auto tables = nlohmann::json::array();
  if (const auto* of = std::get_if<calib::HeldTables>(&held); of != nullptr) {
    for (const auto& table : of->tables)
      tables.push_back({{"name", calib::name(table.motion)},
                        {"nodes", table.value.size()},
                        {"per_direction", !table.half_forward.empty()}});
  }
  return tables;
}

nlohmann::json by_error_json(const std::vector<calib::ErrorLoss>& losses) {
  auto errors = nlohmann::json::array();
  for (const auto& loss : losses)
    errors.push_back({{"name", loss.name},
                      {"rms_um", loss.rms_m * kUmPerM},
                      {"rms_lost_um", loss.rms_lost_m * kUmPerM},
                      {"max_lost_um", loss.max_lost_m * kUmPerM}});
  return errors;
}

}  // namespace

std::vector<std::string> not_held_by(const FormatFacts& facts, const calib::VolumetricModel& model,
                                     bool direction_given) {
  std::vector<std::string> sentences{
      "the uncertainty of the model",
      fmt::format("the validity volume{}: beyond the nodes the control keeps the last value",
                  facts.comments ? ", except as a comment" : ""),
      "the state of the model: after a change of the machine the control continues to correct"};
  if (facts.holds != HeldPart::Errors)
    sentences.emplace_back("other tools: the file is for one tool offset");
  if (model.travel() != nullptr && !facts.per_direction && !direction_given)
    sentences.emplace_back("backlash: the file has the mean of both directions of travel");
  if (model.travel() != nullptr && direction_given)
    sentences.emplace_back("backlash: the file is for one direction of travel");
  if (facts.holds == HeldPart::Errors)
    sentences.emplace_back("the second order of c = -V(p + c): the control takes -V(p)");
  return sentences;
}

std::string report_text(const ExportReport& report) {
  const auto& facts = *report.facts;
  const auto& origin = report.written.origin;
  std::string text = fmt::format("{}: {}\n", facts.name, facts.control);
  for (const auto& sentence : origin.use) text += printable_line(sentence) + "\n";
  text += fmt::format("model {}\nmachine {}\nvolume {}, tool offset {}\n", origin.model_hash,
                      printable_line(origin.machine), origin.volume, origin.tool);
  text += fmt::format("sign: a positive value moves the axis in the {} direction ({})\n",
                      report.written.positive_moves > 0 ? "positive" : "negative",
                      facts.source.empty() ? "given by --positive" : facts.source);
  text += "      added to a commanded position p: c = -V(p + c), V = actual - nominal\n";
  for (const auto& file : report.files) text += fmt::format("file {}\n", printable_line(file));
  text += fmt::format(
      "read back as the control does at {} places: differs by at most {:.6f} nm (allowed {:g} "
      "nm)\n",
      report.proof.places, report.proof.largest_difference_m * 1e9, kExportTolerance_m * 1e9);

  text += held_text(report.held) + loss_text(report.loss) + by_error_text(report.by_error);
  text += "\nnot in the file:\n";
  for (const auto& sentence : report.not_held) text += "  " + sentence + "\n";
  return text;
}

std::string report_json(const ExportReport& report) {
  const auto& origin = report.written.origin;
  const nlohmann::json out{{"format", report.facts->name},
                           {"model_hash", origin.model_hash},
                           {"use", origin.use},
                           {"files", report.files},
                           {"positive_moves", report.written.positive_moves},
                           {"places", report.proof.places},
                           {"largest_difference_nm", report.proof.largest_difference_m * 1e9},
                           {"rms_without_um", in_um(report.loss.rms_without_m)},
                           {"max_without_um", in_um(report.loss.max_without_m)},
                           {"rms_lost_um", in_um(report.loss.rms_lost_m)},
                           {"max_lost_um", in_um(report.loss.max_lost_m)},
                           {"tables", tables_json(report.held)},
                           {"errors", by_error_json(report.by_error)},
                           {"not_held", report.not_held}};
  return json_text(out) + "\n";
}

}  // namespace abbe::daemon
