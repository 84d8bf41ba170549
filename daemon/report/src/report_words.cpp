#include "abbe/report/model_words.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

std::string place_mm(const calib::Vector3& p_m) {
  return fmt::format("{:.1f}, {:.1f}, {:.1f} mm", kMmPerM * p_m.x(), kMmPerM * p_m.y(),
                     kMmPerM * p_m.z());
}

/// Names of the error motions without a table.
std::vector<std::string> missing_tables(const calib::VolumetricModel& model) {
  std::vector<std::string> missing;
  for (const calib::Axis axis : calib::kAllAxes)
    for (const calib::Motion motion : calib::kAllMotions)
      if (!model.tables()->layout().find({motion, axis}))
        missing.push_back(calib::name({motion, axis}));
  return missing;
}

bool is_blocks_datum(const calib::VolumetricModel& model) {
  return model.datum() == calib::ModelDatum::Ball1Blocks;
}

}  // namespace

std::string datum_in_words(const calib::VolumetricModel& model) {
  const std::string name{calib::name(model.datum())};
  if (const auto* polynomials = model.polynomials(); polynomials != nullptr)
    return fmt::format(
        "{}: V is 0 at ball 1 ({}). {}", name, place_mm(polynomials->ball1_m()),
        is_blocks_datum(model)
            ? "The rotation of V about ball 1 is that which the machine measured at the blocks."
            : "The rotation of V about ball 1 comes from another instrument.");

  std::vector<std::string> references;
  for (const calib::Axis axis : calib::kAllAxes)
    references.push_back(
        fmt::format("{} {:.1f} mm", letter(axis),
                    kMmPerM * model.tables()->layout().nodes()[index(axis)].reference_m));
  return fmt::format(
      "{}: positioning and angular errors are 0 at the reference position of their axis ({}), "
      "straightness errors are 0 at the first and the last node; squareness errors act on the "
      "distance from {}. Another datum describes the same machine with other numbers; the values "
      "of "
      "the standards do not depend on it.",
      name, fmt::join(references, ", "),
      model.datum() == calib::ModelDatum::G1 ? "machine zero" : "the reference position");
}

std::vector<std::string> signs_in_words() {
  return {
      "V = actual minus nominal = true position minus reading of the functional point, tool "
      "relative to workpiece, at the scale reading.",
      "Measuring: corrected = reading + V. Positioning: command p + c with c = -V(p + c).",
      "EXX to ECZ as in ISO 230-1: direction of the error, then the moving axis; rotations are "
      "positive counter-clockwise, seen against the axis of rotation.",
      "Squareness tilts the direction of travel only. EC0Y > 0: travelling in +Y the tool moves "
      "towards -X. EB0Z > 0: in +Z towards +X. EA0Z > 0: in +Z towards -Y."};
}

std::vector<std::string> not_in_the_uncertainty(const ModelDocument& document) {
  std::string misfit =
      "errors between the nodes of the tables, and errors that depend on several axes at once";
  if (document.method == "otf")
    misfit += ", as far as they do not repeat at a place beyond chance; else they are in U(V)";
  if (document.model.tables() == nullptr)
    misfit =
        "errors of a higher degree than the polynomials have, as far as touches and array explain "
        "the scatter of the ball centres; else they are in U(V)";
  std::vector<std::string> list{
      misfit, "lack of fit that the residuals do not show",
      "changes of the machine after the measurement: temperature, load, wear, collisions",
      "the workpiece and its clamping, the spindle, the tool, dynamics at other feeds"};
  if (document.method == "otf" && !document.tracker_drift)
    list.emplace_back("drift of the tracker during the run: no reference nests were visited");
  if (document.method == "evemu" && !document.artefact)
    list.emplace_back("thermal expansion of the ball array: the touches were not corrected for it");
  if (!document.recording_gap.empty())
    list.push_back(
        fmt::format("{} (of no effect on the numbers)", cannot_be_checked(document.recording_gap)));
  return list;
}

std::vector<std::string> not_estimable(const ModelDocument& document) {
  const calib::VolumetricModel& model = document.model;
  std::vector<std::string> list{
      "a rigid motion of the whole volume: no measurement on the machine shows it",
      "repeatability and accuracy A of ISO 230-2: a model has no repeated approaches",
      "errors outside the validity volume: nothing was measured there"};
  if (model.tables() == nullptr)
    list.emplace_back(
        "the 21 error motions one by one: touches with one tool show only combinations of them, "
        "which V contains");
  else if (const auto missing = missing_tables(model); !missing.empty())
    list.push_back(fmt::format(
        "{}: with one tool offset they cannot be distinguished from the other errors; V contains "
        "their effect for this tool",
        fmt::join(missing, ", ")));
  if (model.tool_offsets_m().size() == 1)
    list.push_back(fmt::format("V for tools other than {}: one tool offset was measured",
                               tools_in_words(model)));
  if (model.travel() == nullptr)
    list.emplace_back("backlash: the directions of travel were not distinguished; V is their mean");
  return list;
}

std::string tools_in_words(const calib::VolumetricModel& model) {
  std::vector<std::string> tools;
  for (const calib::Vector3& t : model.tool_offsets_m()) tools.push_back(place_mm(t));
  return fmt::format("{}", fmt::join(tools, "; "));
}

std::string method_in_words(const ModelDocument& document) {
  std::string_view what = document.method;
  if (document.method == "otf") what = "laser tracker";
  if (document.method == "evemu") what = "ball array";
  if (document.method == "mfb") what = "Multi-Feature Bar";
  if (document.method == "joint") what = "joint identification";
  return fmt::format("{} ({}{}), estimator {}", what, document.method,
                     document.mode.empty() ? "" : ", " + document.mode, document.estimator);
}

}  // namespace abbe::daemon
